// The page: takes the run's stream and shows it. No request but the stream; what it cannot read it leaves out.
'use strict';

let latest = null;  // { message, picture }
let shownState = '';
let isConnected = false;
let isEnded = false;
let silent_s = 0;
let lastWord = 0;  // when the stream spoke, ms
let map = null;
const nothing = at('events').firstElementChild;

// --- State ----------------------------------------------------------------------------------------------------------
function showState() {
  let state = 'waiting';
  let advice = '';
  if (!isConnected) {
    state = isEnded ? 'ended' : 'gone';
  } else if (silent_s < 0) {
    state = 'waiting';
    advice = 'for a camera: none has given a picture yet. Is one plugged in?';
  } else if (control.paused) {
    state = 'paused';
  } else if (silent_s > 1.5) {
    state = 'silent';
    advice = `The camera has given none for ${Math.floor(silent_s)} s. See whether it is plugged in.`;
  } else if (latest) {
    state = latest.message.state;
    const { reason, chosen_percent: chosen, rival_percent: rival } = latest.message;
    advice = adviceFor(reason, chosen, rival);
  }
  const key = state + advice;
  if (key === shownState) return;
  shownState = key;
  document.title = `Stillmesh: ${showWord(state, advice).toLowerCase()}`;
}

function redraw() {
  if (latest) drawCamera({ ...latest.message, picture: latest.picture });
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
    map.setLinks(message.keyframes, shorts(message.covisible), shorts(message.loops));
    map.setPose(message.pose, message.state, message.image[1] / message.image[0]);
    setText('n-points', String(map.points));
  }
  setText('n-keyframes', String(message.keyframes.length));
  setText('n-loops', String(shorts(message.loops).length / 2));
  if (!message.picture) return;
  const picture = new Image();
  picture.onload = () => {
    if (latest.message !== message) return;  // overtaken
    latest.picture = picture;
    redraw();
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
  stream.addEventListener('control', (e) => {
    heard();
    control = JSON.parse(e.data);
    showControl();
    showState();
  });
  stream.addEventListener('alive', (e) => {
    heard();
    silent_s = JSON.parse(e.data).silent_s;  // below 0: there was none yet
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
  at('show-links').addEventListener('change', () => map && map.showLinks(at('show-links').checked));
  at('legend').addEventListener('change', redraw);
  window.addEventListener('resize', redraw);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => map && map.restyle());
  beginControl();
  connect();
}
begin();
