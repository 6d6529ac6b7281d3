// The report: plays the run that is written into the page. `run` (numbers by frame) is read at once, pictures as they are shown.
'use strict';

const run = readRun(JSON.parse(at('run').textContent));
const film = JSON.parse(at('film').textContent);
const frames = run.time.length;
let current = -1;
let shown = null;  // the picture that lies on the canvas
let wanted = null;
let map = null;
let curves = null;
let mapShown = 0;
let clock = null;  // of the animation while it plays: { last, second }

// --- One frame ------------------------------------------------------------------------------------------------------
function stateOf(i) {
  return STATE_NAMES[run.state[i]];
}
function reasonOf(i) {
  const reason = run.reasons[run.reason[i]];
  return run.state[i] === 3 || reason === 'none' ? '' : reason;
}
function poseOf(i) {
  return run.state[i] === 0 ? null : Array.from(run.pose.subarray(7 * i, 7 * i + 7));
}

// What one frame was, in a line.
function tell(i) {
  const parts = [`${run.time[i].toFixed(2)} s`, `frame ${run.frame[i]}`];
  parts.push(stateOf(i) === 'none' ? 'no pose' : stateOf(i) + (reasonOf(i) ? ` (${reasonOf(i)})` : ''));
  if (run.error && !Number.isNaN(run.error[i])) parts.push(`error ${(100 * run.error[i]).toFixed(2)} cm`);
  const matched = run.still[i] + run.moving[i];
  if (matched > 0) parts.push(`${run.still[i]} static, ${run.moving[i]} moving`);
  if (run.rival[i] > 0) parts.push(rivalWords(run.chosen[i], run.rival[i]));
  if (run.ms[i] > 0) {
    const stages = run.stages.map((name, k) => [name, run.stage[k][i]]).filter(([, ms]) => ms >= 0.05)
      .sort((a, b) => b[1] - a[1]).slice(0, 4).map(([name, ms]) => `${name} ${ms.toFixed(1)}`);
    parts.push(`${run.ms[i].toFixed(1)} ms` + (stages.length > 0 ? ` (${stages.join(', ')})` : ''));
  }
  return parts.join(' · ');
}

// --- The picture ----------------------------------------------------------------------------------------------------
// The nearest that was kept.
function pictureOf(i) {
  const number = run.frame[i];
  let low = 0;
  for (let high = film.pictures.length; high - low > 1;) {
    const middle = (low + high) >> 1;
    if (film.pictures[middle].frame <= number) low = middle; else high = middle;
  }
  const next = film.pictures[low + 1];
  const here = film.pictures[low];
  return next && next.frame - number < number - here.frame ? next : here;
}

function decode(kept) {
  const place = shorts(kept.at);
  const kinds = new Uint8Array(bytesOf(kept.kinds));
  const features = new Int16Array(2 * place.length);
  for (let i = 0; i < kinds.length / 2; ++i) {
    features.set([place[2 * i], place[2 * i + 1], kinds[2 * i] === 255 ? -1 : kinds[2 * i], kinds[2 * i + 1]], 4 * i);
  }
  const edges = (base64) => {
    const ends = new Uint16Array(bytesOf(base64));
    const made = new Int16Array(2 * ends.length);
    for (let i = 0; i < ends.length; ++i) made.set([place[2 * ends[i]], place[2 * ends[i] + 1]], 2 * i);
    return made;
  };
  return { frame: kept.frame, image: kept.image, features, kept: edges(kept.kept), cut: edges(kept.cut) };
}

function showPicture(i) {
  if (film.pictures.length === 0) return;
  const kept = pictureOf(i);
  const number = kept.frame;
  setText('picture-of', number === run.frame[i] ? '' : `The nearest picture that was kept: of frame ${number}.`);
  if (wanted === number) return;
  wanted = number;
  const picture = new Image();
  picture.onload = () => {
    if (wanted !== number) return;  // overtaken
    shown = { ...decode(kept), picture };
    at('camera').dataset.frame = String(number);
    drawCamera(shown);
  };
  picture.src = `data:image/${kept.type};base64,${kept.picture}`;
}

// --- The map --------------------------------------------------------------------------------------------------------
// Of the map that frame `i` is in: its path, and what is known of the last one.
function showMap(i) {
  if (run.map[i] === mapShown) return;
  mapShown = run.map[i];
  map.clear();
  const places = [];
  map.framesOfPlaces = [];
  const poses = [];
  let isGap = true;
  for (let k = 0; k < frames; ++k) {
    if (run.map[k] !== mapShown) continue;
    const pose = poseOf(k);
    if (k > 0 && run.time[k] - run.time[k - 1] > run.gap_s) isGap = true;
    if (pose) {
      places.push([pose[0], pose[1], pose[2], run.state[k] + (isGap ? GAP : 0)]);
      map.framesOfPlaces.push(k);
      poses.push(pose);
    }
    isGap = !pose;
  }
  map.addPlaces(0, places);
  map.knowUp(poses.filter((_, k) => k % Math.ceil(poses.length / 200) === 0));
  if (mapShown === film.map) {
    for (const cloud of film.clouds) map.addCloud(cloud.keyframe, shorts(cloud.points));
    map.setKeyframes(film.keyframes);
    map.setLinks(film.keyframes, shorts(film.covisible), shorts(film.loops));
  }
  if (run.truth && mapShown === run.truthMap) map.path.setLine('truth', run.truth, 'soft', true);
  setText('n-points', String(map.points));
  setText('n-keyframes', String(map.keyframes.size));
  setText('n-loops', at('map').dataset.loops);
  if (!map.follow) map.all();
}

// --- Going to a frame -----------------------------------------------------------------------------------------------
function show(i) {
  i = Math.min(frames - 1, Math.max(0, i));
  if (i === current) return;
  current = i;
  const slider = at('slider');
  slider.value = String(i);
  slider.setAttribute('aria-valuetext', tell(i));
  showWord(stateOf(i), adviceFor(reasonOf(i), run.chosen[i], run.rival[i]));
  const pose = poseOf(i);
  setText('frame', String(run.frame[i]));
  setText('position', pose ? pose.slice(0, 3).map((v) => v.toFixed(2)).join('  ') : '–');
  setText('mapnumber', String(run.map[i]));
  if (curves.over === null) setText('readout', tell(i));
  showPicture(i);
  if (map) {
    showMap(i);
    const picture = film.pictures[0];
    map.setPose(pose, stateOf(i), picture ? picture.image[1] / picture.image[0] : 0.75);
  }
  curves.setNow(run.time[i]);
}
function stop() {
  clock = null;
  setText('play', 'Play');
  at('play').setAttribute('aria-pressed', 'false');
}
function play() {
  if (clock) return stop();
  if (current >= frames - 1) show(0);
  clock = { last: performance.now(), second: run.time[current] };
  setText('play', 'Pause');
  at('play').setAttribute('aria-pressed', 'true');
  requestAnimationFrame(tick);
}
function tick(now) {
  if (!clock) return;
  clock.second += Math.max(0, now - clock.last) / 1000 * Number(at('speed').value);
  clock.last = now;
  show(indexAt(run.time, clock.second));
  if (clock.second >= run.time[frames - 1]) stop(); else requestAnimationFrame(tick);
}
function step(by) {
  stop();
  show(current + by);
}
// To the next stretch that was not tracked, round the end.
function goToTrouble(by) {
  stop();
  for (let n = 1; n <= frames; ++n) {
    const i = (current + by * n + frames * 2) % frames;
    const isBegin = run.state[i] !== 3 && (i === 0 || run.state[i - 1] === 3);
    if (isBegin) return show(i);
  }
}

function onKey(e) {
  if (e.altKey || e.ctrlKey || e.metaKey || e.target.closest('select, #map')) return;
  const isOnButton = e.target.closest('button, a, input[type=checkbox]');
  if (e.key === ' ' && !isOnButton) play();
  else if (e.key === 'ArrowLeft') step(e.shiftKey ? -10 : -1);
  else if (e.key === 'ArrowRight') step(e.shiftKey ? 10 : 1);
  else if (e.key === 'Home') step(-frames);
  else if (e.key === 'End') step(frames);
  else if (e.key === 'n' || e.key === 'N') goToTrouble(1);
  else if (e.key === 'p' || e.key === 'P') goToTrouble(-1);
  else return;
  e.preventDefault();
}

// --- What lies around -----------------------------------------------------------------------------------------------
function makeCurves() {
  const panels = [{ kind: 'states', title: 'How sure it was', unit: '',
    series: [{ name: '', times: run.time, values: run.state, colour: 'tracked' }] }];
  if (run.error) {
    panels.push({ kind: 'line', title: 'Error of the path', unit: 'cm', least: 0.2,
      series: [{ name: 'against the truth', times: run.time, values: run.error.map((v) => 100 * v), colour: 'tracked' }] });
  }
  const share = (i, of) => (run.still[i] + run.moving[i] > 0 ? 100 * of[i] / (run.still[i] + run.moving[i]) : 0);
  panels.push({ kind: 'share', title: 'What stood still', unit: '%', series: [
    { name: 'static: the pose is from these', times: run.time, values: run.ms.map((_, i) => share(i, run.still)), colour: 'still' },
    { name: 'moving: left out', times: run.time, values: run.ms.map((_, i) => share(i, run.moving)), colour: 'moving' }] });
  panels.push({ kind: 'stack', title: 'Time of a frame', unit: 'ms', least: 1, limit: { value: run.period_ms, name: 'until the next frame' },
    series: run.stages.map((name, k) => ({ name, times: run.time, values: run.stage[k], colour: `stage-${k}` })) });
  return new Curves(at('curves'), run.time[frames - 1], panels, {
    onSeek: (second) => { stop(); show(indexAt(run.time, second)); },
    onPoint: (second) => {
      const i = second === null ? current : indexAt(run.time, second);
      setText('readout', tell(i));
      if (!map) return;
      map.path.setMark(second === null ? null : poseOf(i));
      map.change();
    },
  });
}

function listEvents() {
  if (run.events.length === 0) return;
  at('events').replaceChildren(...run.events.map(([second, sentence]) => {
    const item = document.createElement('li');
    const go = item.appendChild(document.createElement('button'));
    go.type = 'button';
    go.textContent = `${second.toFixed(1)} s`;
    go.addEventListener('click', () => { stop(); show(indexAt(run.time, second)); });
    item.append(' ' + sentence);
    return item;
  }));
  curves.setMarks(run.events.map(([second]) => second));
}

// Where most moves: the picture that says most.
function busiest() {
  let best = 0;
  let most = -1;
  for (const { frame } of film.pictures) {
    const i = indexAt(run.frame, frame);
    const share = run.moving[i] / Math.max(50, run.still[i] + run.moving[i]);
    if (run.frame[i] !== frame || run.state[i] < 2 || share <= most) continue;
    most = share;
    best = i;
  }
  return best;
}

function begin() {
  const note = document.createElement('p');
  note.id = 'picture-of';
  note.className = 'note';
  at('legend').before(note);
  try {
    map = new MapView(at('map'), (follow) => at('follow').setAttribute('aria-pressed', String(follow)),
      (place) => { stop(); show(map.framesOfPlaces[place]); });
    map.setFollow(false);
  } catch (error) {
    at('map').hidden = true;
    at('no-map').hidden = false;
  }
  if (run.truth) {
    const label = document.createElement('span');
    const sign = label.appendChild(document.createElement('i'));
    sign.className = 'stroke dashed';
    sign.style.setProperty('--of', 'var(--soft)');
    label.append('truth');
    at('n-points').parentElement.before(label);
  }
  curves = makeCurves();
  at('slider').max = String(frames - 1);
  at('slider').addEventListener('input', () => { stop(); show(Number(at('slider').value)); });
  at('back').addEventListener('click', () => step(-1));
  at('forward').addEventListener('click', () => step(1));
  at('play').addEventListener('click', play);
  at('trouble').addEventListener('click', () => goToTrouble(1));
  at('trouble').disabled = run.state.every((state) => state === 3);
  at('zoom-in').addEventListener('click', () => curves.zoom(0.5));
  at('zoom-out').addEventListener('click', () => curves.zoom(2));
  at('zoom-all').addEventListener('click', () => curves.all());
  at('csv').addEventListener('click', () => { at('csv').href = URL.createObjectURL(new Blob([csvOf(run)], { type: 'text/csv' })); });
  at('follow').addEventListener('click', () => map && map.setFollow(!map.follow));
  at('above').addEventListener('click', () => map && map.fromAbove());
  at('behind').addEventListener('click', () => map && map.fromBehind());
  at('legend').addEventListener('change', () => drawCamera(shown));
  window.addEventListener('resize', () => drawCamera(shown));
  document.addEventListener('keydown', onKey);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => map && map.restyle());
  listEvents();
  show(busiest());
}
if (frames > 0) begin();
