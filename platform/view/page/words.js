// What the pages share: the words for each state, numbers out of base64, and when something is drawn.
'use strict';

const at = (id) => document.getElementById(id);

// What each state means, and the one thing to do.
const STATES = {
  waiting: ['○', 'Waiting', 'for the first picture.'],
  tracked: ['●', 'Tracked', 'The pose can be trusted.'],
  unsure: ['▲', 'Unsure', 'Measured, but another explanation is nearly as good. Move slowly.'],
  predicted: ['◆', 'Predicted', 'Nothing was measured; the last motion is carried on. Turn back to what it saw before.'],
  none: ['■', 'No pose', 'It does not know where it is. Bring the camera back to a place that it has seen.'],
  paused: ['‖', 'Paused', 'It goes on when somebody who may steer says so.'],
  silent: ['✕', 'No pictures', 'The camera gives none. See whether it is plugged in.'],
  ended: ['■', 'The run has ended', 'Start it again, and this page goes on.'],
  gone: ['✕', 'No connection', 'Is the program running, and the network there? Trying again every second.'],
};
const REASONS = {
  'rival motion': 'Show the camera more of what stands still.',
  'unclear motion': 'The motion found explains too little of the picture. Move slowly, towards what stands still.',
  'few points': 'Too few points agree. Look at something with texture.',
  'no depth': 'Too little of the picture has depth. Stay between half a metre and four metres from what it sees.',
  'jump': 'The path was off within the last second. Hold still for a second.',
  'map newly made here': 'The map was made anew here, from few points. Look back at what it saw before.',
  'against the hint': 'It contradicts wheels or gyroscope. See whether a wheel slips.',
  'camera fault': 'Calibration or depth cannot be right. Read what happened, below.',
  'old pictures': 'The camera repeats old pictures. Unplug it and plug it in again.',
};

// How much two motions explain, in percent.
const rivalWords = (chosen, rival) => `the motion chosen explains ${chosen} % of the surface in view, its rival ${rival} %`;
// What to do about a reason, '' where there is nothing; where a rival is the reason, how much each motion explains.
function adviceFor(reason, chosen, rival) {
  if (reason !== 'rival motion') return REASONS[reason] || '';
  return `Rival motion: ${rivalWords(chosen, rival)}. ${REASONS[reason]}`;
}

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}
const shorts = (base64) => new Int16Array(bytesOf(base64));
const floats = (base64) => new Float32Array(bytesOf(base64));
function setText(id, text) {
  const element = at(id);
  if (element.textContent !== text) element.textContent = text;
}
// What has a draw(): once with the browser's next picture, however often it changed.
class Drawing {
  change() {
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => {
      this.isWaiting = false;
      this.draw();
    });
  }
}
// The state's sign, word and advice, its own unless another is given. Returns the word.
function showWord(state, advice) {
  const [sign, word, usual] = STATES[state] || STATES.none;
  at('state').dataset.state = state;
  setText('sign', sign);
  setText('word', word);
  setText('advice', advice || usual);
  return word;
}
