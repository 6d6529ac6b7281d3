// The page: takes the run's stream and shows it. No request but the stream; what it cannot read it leaves out.
'use strict';

const at = (id) => document.getElementById(id);

// What each state means, and the one thing to do.
const STATES = {
  waiting: ['○', 'Waiting', 'for the first picture.'],
  tracked: ['●', 'Tracked', 'The pose can be trusted.'],
  unsure: ['▲', 'Unsure', 'Measured, but another explanation is nearly as good. Move slowly.'],
  predicted: ['◆', 'Predicted', 'Nothing was measured; the last motion is carried on. Turn back to what it saw before.'],
  none: ['■', 'No pose', 'It does not know where it is. Bring the camera back to a place that it has seen.'],
  silent: ['✕', 'No pictures', 'The camera gives none. See whether it is plugged in.'],
  ended: ['■', 'The run has ended', 'Start it again, and this page goes on.'],
  gone: ['✕', 'No connection', 'Is the program running, and the network there? Trying again every second.'],
};
const REASONS = {
  'rival motion': 'Another motion explains the picture nearly as well. Show the camera more of what stands still.',
  'unclear motion': 'The motion found explains too little of the picture. Move slowly, towards what stands still.',
  'few points': 'Too few points agree. Look at something with texture.',
  'no depth': 'Too little of the picture has depth. Stay between half a metre and four metres from what it sees.',
  'jump': 'The pose jumped within the last second. Hold still for a second.',
  'map newly made here': 'The map was made anew here, from few points. Look back at what it saw before.',
  'against the hint': 'It contradicts wheels or gyroscope. See whether a wheel slips.',
  'camera fault': 'Calibration or depth cannot be right. Read what happened, below.',
  'old pictures': 'The camera repeats old pictures. Unplug it and plug it in again.',
};
// Groups that agree with the pose are blue, those that move against it orange, others grey; neighbours differ in tint, and
// each has a letter.
const STATIC_COLOUR = '#56b4e9';
const MOVING_COLOUR = '#ffb000';
const TINTS = { still: [STATIC_COLOUR, '#9fd8ff', '#3d8fd6'], moving: [MOVING_COLOUR, '#ff8340', '#ffd980'], unknown: ['#c8c8c8', '#8f8f8f'] };

let latest = null;  // { message, picture }
let shownState = '';
let isConnected = false;
let isEnded = false;
let silent_s = 0;
let lastWord = 0;  // when the stream spoke, ms
let map = null;
const nothing = at('events').firstElementChild;

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

// --- State ----------------------------------------------------------------------------------------------------------
function showState() {
  let state = 'waiting';
  let advice = '';
  if (!isConnected) {
    state = isEnded ? 'ended' : 'gone';
  } else if (silent_s > 1.5) {
    state = 'silent';
    advice = `The camera has given none for ${Math.floor(silent_s)} s. See whether it is plugged in.`;
  } else if (latest) {
    state = latest.message.state;
    advice = REASONS[latest.message.reason] || '';
  }
  const [sign, word, usual] = STATES[state] || STATES.none;
  const key = state + advice;
  if (key === shownState) return;
  shownState = key;
  at('state').dataset.state = state;
  setText('sign', sign);
  setText('word', word);
  setText('advice', advice || usual);
  document.title = `Stillmesh: ${word.toLowerCase()}`;
}

// --- The camera's picture -------------------------------------------------------------------------------------------
// A group is where most of its features with a verdict are.
function groupsOf(features) {
  const byPlace = new Map();
  const groups = new Map();
  for (let i = 0; i < features.length; i += 4) {
    const group = features[i + 2];
    if (group < 0) continue;
    byPlace.set(features[i] * 65536 + features[i + 1], group);
    const g = groups.get(group) || { count: 0, still: 0, moving: 0, x: 0, y: 0 };
    g.count += 1;
    g.still += features[i + 3] === 1 ? 1 : 0;
    g.moving += features[i + 3] === 2 ? 1 : 0;
    g.x += features[i];
    g.y += features[i + 1];
    groups.set(group, g);
  }
  const ordered = [...groups.values()].filter((g) => g.count >= 4).sort((a, b) => b.count - a.count);
  const used = { still: 0, moving: 0, unknown: 0 };
  ordered.forEach((g, i) => {
    g.kind = g.still > g.moving ? 'still' : g.moving > 0 ? 'moving' : 'unknown';
    g.colour = TINTS[g.kind][used[g.kind]++ % TINTS[g.kind].length];
    g.name = String.fromCharCode(65 + Math.min(i, 25)) + (i < 3 && g.kind !== 'unknown' ? ' ' + g.kind : '');
  });
  const colourAt = (x, y) => (groups.get(byPlace.get(x * 65536 + y)) || {}).colour;
  return { ordered, colourAt };
}

function drawEdges(context, edges, scale, colourOf) {
  const strokes = new Map();
  for (let i = 0; i < edges.length; i += 4) {
    const colour = colourOf(edges[i], edges[i + 1], edges[i + 2], edges[i + 3]);
    if (!strokes.has(colour)) strokes.set(colour, new Path2D());
    const path = strokes.get(colour);
    path.moveTo(edges[i] * scale, edges[i + 1] * scale);
    path.lineTo(edges[i + 2] * scale, edges[i + 3] * scale);
  }
  for (const [colour, path] of strokes) {
    context.strokeStyle = colour;
    context.stroke(path);
  }
}

function drawFeatures(context, features, scale, unit) {
  const still = new Path2D();
  const moving = new Path2D();
  const neither = new Path2D();
  const r = 1.6 * unit;
  const counts = [0, 0, 0];
  for (let i = 0; i < features.length; i += 4) {
    const x = features[i] * scale;
    const y = features[i + 1] * scale;
    const kind = features[i + 3];
    counts[kind] += 1;
    if (kind === 1) {
      still.moveTo(x + r, y);
      still.arc(x, y, r, 0, 7);
    } else if (kind === 2) {
      moving.moveTo(x - 1.8 * r, y - 1.8 * r);
      moving.lineTo(x + 1.8 * r, y + 1.8 * r);
      moving.moveTo(x + 1.8 * r, y - 1.8 * r);
      moving.lineTo(x - 1.8 * r, y + 1.8 * r);
    } else {
      neither.moveTo(x + r, y);
      neither.arc(x, y, r, 0, 7);
    }
  }
  context.setLineDash([]);
  if (at('show-neither').checked) {
    context.lineWidth = 0.8 * unit;
    context.strokeStyle = '#ffffffb0';
    context.stroke(neither);
  }
  if (at('show-static').checked) {
    context.fillStyle = STATIC_COLOUR;
    context.fill(still);
  }
  if (at('show-moving').checked) {
    context.lineWidth = 3.4 * unit;
    context.strokeStyle = '#000000c0';
    context.stroke(moving);
    context.lineWidth = 1.8 * unit;
    context.strokeStyle = MOVING_COLOUR;
    context.stroke(moving);
  }
  ['neither', 'static', 'moving'].forEach((name, i) => setText('n-' + name, String(counts[i])));
}

function nameGroups(context, ordered, scale, unit) {
  context.font = `600 ${12 * unit}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  for (const g of ordered.slice(0, 6)) {
    const x = g.x / g.count * scale;
    const y = g.y / g.count * scale;
    const width = context.measureText(g.name).width + 8 * unit;
    context.fillStyle = '#000000c0';
    context.fillRect(x - width / 2, y - 9 * unit, width, 18 * unit);
    context.fillStyle = g.colour;
    context.fillText(g.name, x, y);
  }
}

function drawCamera() {
  if (!latest || !latest.picture) return;
  const { message, picture } = latest;
  const canvas = at('camera');
  const [width, height] = message.image;
  const dots = Math.min(window.devicePixelRatio || 1, 2);
  const wide = Math.max(1, Math.round(canvas.clientWidth * dots));
  const high = Math.round(wide * height / width);
  if (canvas.width !== wide || canvas.height !== high) {
    canvas.width = wide;
    canvas.height = high;
    canvas.style.aspectRatio = `${width} / ${height}`;
  }
  const context = canvas.getContext('2d');
  context.drawImage(picture, 0, 0, wide, high);
  const scale = wide / width / 8;  // coordinates are eighths of a pixel
  const { ordered, colourAt } = groupsOf(message.features);
  if (at('show-kept').checked) {
    context.setLineDash([]);
    context.lineWidth = 1.1 * dots;
    context.globalAlpha = 0.75;
    drawEdges(context, message.kept, scale, (x0, y0, x1, y1) =>
      colourAt(x0, y0) || colourAt(x1, y1) || TINTS.unknown[0]);
  }
  if (at('show-cut').checked) {
    context.setLineDash([3 * dots, 3 * dots]);
    context.lineWidth = 1.3 * dots;
    context.globalAlpha = 0.9;
    drawEdges(context, message.cut, scale, () => MOVING_COLOUR);
  }
  context.globalAlpha = 1;
  drawFeatures(context, message.features, scale, dots);
  if (at('show-kept').checked) nameGroups(context, ordered, scale, dots);
}

// --- Tables ---------------------------------------------------------------------------------------------------------
const rows = new Map();
function row(table, name, isSum) {
  const key = table + name;
  if (rows.has(key)) return rows.get(key);
  const tr = at(table).tBodies[0].insertRow();
  if (isSum) tr.className = 'sum';
  const th = document.createElement('th');
  th.scope = 'row';
  th.textContent = name;
  const rail = document.createElement('span');
  rail.className = 'rail';
  const bar = rail.appendChild(document.createElement('span'));
  const mark = rail.appendChild(document.createElement('em'));
  mark.hidden = true;
  tr.append(th);
  tr.insertCell().append(rail);
  const made = { rail, bar, mark, value: tr.insertCell(), mean: null };
  rows.set(key, made);
  return made;
}
function setBar(r, share, text) {
  r.bar.style.width = `${Math.min(100, 100 * share).toFixed(1)}%`;
  r.rail.classList.toggle('over', share > 1);
  r.value.textContent = text;
}
// Numbers that change ten times a second cannot be read: the mean of the last second or so.
function smooth(r, value) {
  r.mean = r.mean === null ? value : 0.85 * r.mean + 0.15 * value;
  return r.mean;
}

function showTimes(message) {
  if (message.ms === 0) return;
  const budget = message.budget_ms || 33.3;
  let top = 0;
  for (const [name, ms] of message.stages) top = Math.max(top, smooth(row('stages', name, false), ms));
  for (const [name] of message.stages) {
    const r = row('stages', name, false);
    setBar(r, r.mean / Math.max(top, 0.01), `${r.mean.toFixed(2)} ms`);
  }
  const sum = row('stages', 'frame, of its budget', true);
  const mean = smooth(sum, message.ms);
  setBar(sum, mean / budget, `${mean.toFixed(1)} ms`);
  setText('budget', mean > budget
    ? `More than the ${budget.toFixed(1)} ms until the camera's next picture: pictures are late. Try --half or --limits pocket.`
    : `${(100 * mean / budget).toFixed(0)} % of the ${budget.toFixed(1)} ms until the camera's next picture; the rest is for mapping.`);
}

function showPools(message) {
  for (const pool of message.pools) {
    const r = row('pools', pool.name, false);
    const limit = Math.max(1, pool.limit);
    setBar(r, pool.now / limit, `${pool.now} of ${pool.limit}`);
    r.mark.hidden = pool.most === 0;
    r.mark.style.left = `calc(${(100 * Math.min(1, pool.most / limit)).toFixed(1)}% - 2px)`;
  }
}

// --- The stream -----------------------------------------------------------------------------------------------------
function onFrame(event) {
  const message = JSON.parse(event.data);
  for (const key of ['kept', 'cut', 'features']) message[key] = shorts(message[key]);
  silent_s = 0;
  const before = latest;
  latest = { message, picture: before && before.picture };
  showState();
  setText('frame', String(message.frame));
  setText('position', message.pose ? message.pose.slice(0, 3).map((v) => v.toFixed(2)).join('  ') : '–');
  setText('mapnumber', String(message.map));
  showTimes(message);
  showPools(message);
  if (map) {
    map.setKeyframes(message.keyframes);
    map.setPose(message.pose, message.state, message.image[1] / message.image[0]);
    setText('n-points', String(map.points));
  }
  setText('n-keyframes', String(message.keyframes.length));
  if (!message.picture) return;
  const picture = new Image();
  picture.onload = () => {
    if (latest.message !== message) return;  // overtaken
    latest.picture = picture;
    drawCamera();
  };
  picture.src = 'data:image/png;base64,' + message.picture;
}

function onNews(event) {
  const news = JSON.parse(event.data);
  const path = floats(news.path);
  const places = [];
  for (let i = 0; i < path.length; i += 4) places.push([path[i], path[i + 1], path[i + 2], path[i + 3]]);
  if (map) {
    if (news.new_map) map.clear();
    map.addPlaces(news.path_begin, places);
    for (const cloud of news.clouds) map.addCloud(cloud.keyframe, shorts(cloud.points));
  }
  const list = at('events');
  for (const sentence of news.events) {
    nothing.remove();
    const item = document.createElement('li');
    item.textContent = sentence;
    list.prepend(item);
    while (list.children.length > 50) list.lastElementChild.remove();
  }
}

function connect() {
  const stream = new EventSource('/stream');
  const heard = () => {
    lastWord = Date.now();
    isConnected = true;
    isEnded = false;
  };
  const lose = (ended) => {
    stream.close();
    clearInterval(watch);
    isConnected = false;
    isEnded = ended || isEnded;
    showState();
    setTimeout(connect, 1000);
  };
  stream.addEventListener('open', () => {
    heard();
    latest = null;
    rows.forEach((r) => { r.mean = null; });
    at('events').replaceChildren(nothing);  // all of them are told again
    showState();
  });
  stream.addEventListener('frame', (e) => { heard(); onFrame(e); });
  stream.addEventListener('news', (e) => { heard(); onNews(e); });
  stream.addEventListener('alive', (e) => {
    heard();
    silent_s = Math.max(0, JSON.parse(e.data).silent_s);
    showState();
  });
  stream.addEventListener('end', () => lose(true));
  stream.addEventListener('error', () => lose(false));
  lastWord = Date.now();
  // A connection that says nothing, not even that it is alive, is none.
  const watch = setInterval(() => { if (Date.now() - lastWord > 5000) lose(false); }, 1000);
}

function begin() {
  try {
    map = new MapView(at('map'), (follow) => at('follow').setAttribute('aria-pressed', String(follow)));
  } catch (error) {
    at('map').hidden = true;
    at('no-map').hidden = false;
  }
  at('follow').addEventListener('click', () => map && map.setFollow(!map.follow));
  at('above').addEventListener('click', () => map && map.fromAbove());
  at('behind').addEventListener('click', () => map && map.fromBehind());
  at('legend').addEventListener('change', drawCamera);
  window.addEventListener('resize', drawCamera);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => map && map.restyle());
  connect();
}
begin();
