// What may be done to the run from here: by who has the token, which comes behind the # of the address (no server is told that
// part) or is typed. A command is asked for, and done by the run between two frames; how it then stands comes with the stream.
'use strict';

let control = { may_steer: false, can_pause: false, can_save: false, can_reset: false, can_save_map: false, can_localise: false,
  paused: false, saving: true, speed: 0, localising: false, take: [] };
let token = sessionStorage.getItem('token') || '';

function takeToken() {
  const given = /^#token=([\w-]+)$/.exec(location.hash);
  if (!given) return;
  token = given[1];
  sessionStorage.setItem('token', token);
  history.replaceState(null, '', location.pathname);  // not in a picture of the screen, nor in a link that is sent on
}

function showControl() {
  const can = ['can_pause', 'can_save', 'can_reset', 'can_save_map', 'can_localise'].some((what) => control[what]);
  const isShown = control.may_steer && can;
  at('control').hidden = !isShown;
  at('token-box').hidden = token !== '';
  at('steer').hidden = token === '';
  setText('pause', control.paused ? 'Go on' : 'Pause');
  at('pause').setAttribute('aria-pressed', String(control.paused));
  for (const id of ['pause', 'step', 'pace']) at(id).disabled = !control.can_pause;
  at('pace').value = String(control.speed);
  at('saving').disabled = !control.can_save;
  setText('saving', control.saving ? 'Stop saving' : 'Save again');
  at('reset').disabled = !control.can_reset;
  at('save-map').disabled = !control.can_save_map;
  for (const [id, paths] of files) at(id).hidden = !(control.may_steer && token !== '' && paths.every((path) => control.take.includes(path)));
  at('localise').disabled = !control.can_localise;
  at('localise').setAttribute('aria-pressed', String(control.localising));
}

const files = [['take-map', ['/room.map']], ['take-grid', ['/grid.yaml', '/grid.pgm']], ['take-cloud', ['/cloud.ply']]];

// Who asks for a file says the token, which a link cannot.
async function take(path) {
  try {
    const answer = await fetch(path, { headers: { 'X-Stillmesh-Token': token } });
    if (!answer.ok) {
      setText('taken', `${path.slice(1)}: ${(await answer.text()).trim()}`);
      return;
    }
    const file = await answer.blob();
    const link = document.createElement('a');
    link.href = URL.createObjectURL(file);
    link.download = path.slice(1);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    setText('taken', `${path.slice(1)}: ${(file.size / 1e6).toFixed(2)} MB, as it was saved last.`);
  } catch (error) {
    setText('taken', 'The program does not answer.');
  }
}

const ofMap = ['save_map', 'localise=0', 'localise=1', 'reset'];  // done behind a frame

async function ask(command) {
  setText('said', '');
  try {
    const answer = await fetch('/command', { method: 'POST', body: command, headers: { 'X-Stillmesh-Token': token } });
    if (answer.status === 403) {
      token = '';
      sessionStorage.removeItem('token');
      showControl();
    }
    if (answer.status !== 202) setText('said', (await answer.text()).trim());
    else if (control.paused && ofMap.includes(command)) setText('said', 'With the next frame.');
  } catch (error) {
    setText('said', 'The program does not answer.');
  }
}

function beginControl() {
  takeToken();
  at('pause').addEventListener('click', () => ask(control.paused ? 'resume' : 'pause'));
  at('step').addEventListener('click', () => ask('step'));
  at('pace').addEventListener('change', () => ask(`speed=${at('pace').value}`));
  at('saving').addEventListener('click', () => ask(`saving=${control.saving ? 0 : 1}`));
  at('save-map').addEventListener('click', () => ask('save_map'));
  for (const [id, paths] of files) at(id).addEventListener('click', async () => { for (const path of paths) await take(path); });
  at('localise').addEventListener('click', () => ask(`localise=${control.localising ? 0 : 1}`));
  // What is lost by it does not come back: a second press within three seconds.
  let armed = 0;
  at('reset').addEventListener('click', () => {
    if (Date.now() - armed < 3000) {
      armed = 0;
      setText('reset', 'New map');
      ask('reset');
      return;
    }
    armed = Date.now();
    setText('reset', 'Press again: the map is laid aside');
    setTimeout(() => setText('reset', 'New map'), 3000);
  });
  at('token').addEventListener('change', () => {
    token = at('token').value.trim();
    at('token').value = '';
    sessionStorage.setItem('token', token);
    showControl();
  });
  showControl();
}
