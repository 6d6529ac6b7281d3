// Runs side by side: their numbers, curves over the same axis, and paths.
'use strict';

const runs = JSON.parse(at('runs').textContent).map(({ name, data }) => ({ ...readRun(data), name }));
const colourOfRun = (i) => `run-${i}`;
const DASHES = [null, [7, 4], [2, 3], [10, 3, 2, 3], [4, 2], [1, 2]];

function element(name, text, scope) {
  const made = document.createElement(name);
  made.textContent = text;
  if (scope) made.scope = scope;
  return made;
}
function digits(value) {
  return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(4)));
}

function showNumbers() {
  const table = at('numbers');
  const head = table.tHead.insertRow();
  head.append(element('th', '', 'col'));
  runs.forEach((run, i) => {
    const th = element('th', '', 'col');
    const sign = th.appendChild(document.createElement('i'));
    sign.className = DASHES[i] ? 'stroke dashed' : 'stroke';
    sign.style.setProperty('--of', `var(--${colourOfRun(i)})`);
    th.append(run.name);
    head.append(th);
  });
  const text = (name, get) => {
    const row = table.tBodies[0].insertRow();
    row.append(element('th', name, 'row'));
    for (const run of runs) row.append(element('td', get(run)));
  };
  text('what', (run) => run.input);
  text('limits', (run) => run.limits);
  runs[0].numbers.forEach(([name, unit, , isLessBetter]) => {
    const values = runs.map((run) => (run.numbers.find((n) => n[0] === name) || [])[2] ?? null);
    if (values.every((value) => value === null)) return;
    const known = values.filter((value) => value !== null);
    const best = isLessBetter ? Math.min(...known) : Math.max(...known);
    const isTold = isLessBetter !== null && known.length > 1 && known.some((v) => Math.abs(v - best) > 0.01 * Math.abs(best));
    const row = table.tBodies[0].insertRow();
    row.append(element('th', unit ? `${name}, ${unit}` : name, 'row'));
    for (const value of values) {
      const td = element('td', value === null ? '–' : digits(value) + (isTold && value === best ? ' ✓' : ''));
      if (isTold && value === best) td.style.fontWeight = '600';
      row.append(td);
    }
  });
  text('state hash', (run) => run.state_hash);
}

function makeCurves() {
  const lines = (get) => runs.map((run, i) => ({ name: run.name, times: run.time, values: get(run), colour: colourOfRun(i), dash: DASHES[i] }))
    .filter((series) => series.values);
  const panels = runs.map((run) => ({ kind: 'states', title: `How sure it was: ${run.name}`, unit: '',
    series: [{ name: '', times: run.time, values: run.state, colour: 'tracked' }] }));
  const errors = lines((run) => run.error && run.error.map((v) => 100 * v));
  if (errors.length > 0) panels.push({ kind: 'line', title: 'Error of the path', unit: 'cm', least: 0.2, series: errors });
  panels.push({ kind: 'line', title: 'Static of what was matched', unit: '%', least: 100,
    series: lines((run) => run.ms.map((_, i) => (run.still[i] + run.moving[i] > 0 ? 100 * run.still[i] / (run.still[i] + run.moving[i]) : NaN))) });
  panels.push({ kind: 'line', title: 'Time of a frame', unit: 'ms', least: 1, series: lines((run) => run.ms) });
  const end = Math.max(...runs.map((run) => run.time[run.time.length - 1] || 0));
  const tell = (second) => {
    setText('readout', second === null ? 'Point at a curve to read it.' : `${second.toFixed(2)} s: ` + runs.map((run) => {
      const i = indexAt(run.time, second);
      const error = run.error && !Number.isNaN(run.error[i]) ? `, ${(100 * run.error[i]).toFixed(2)} cm` : '';
      return `${run.name}: ${STATE_NAMES[run.state[i]]}${error}, ${run.ms[i].toFixed(1)} ms`;
    }).join(' · '));
  };
  return new Curves(at('curves'), end, panels, { onPoint: tell, onSeek: (second) => { curves.setNow(second); tell(second); } });
}

function showPaths() {
  const map = new MapView(at('map'), () => {});
  map.setFollow(false);
  const legend = at('path-legend');
  const poses = [];
  runs.forEach((run, i) => {
    const places = new Float32Array(3 * run.time.length).fill(NaN);
    for (let k = 0; k < run.time.length; ++k) {
      if (run.state[k] === 0 || run.map[k] !== 1) continue;
      places.set(run.pose.subarray(7 * k, 7 * k + 3), 3 * k);
      if (k % Math.ceil(run.time.length / 50) === 0) poses.push(Array.from(run.pose.subarray(7 * k, 7 * k + 7)));
    }
    map.path.setLine(String(i), places, colourOfRun(i), Boolean(DASHES[i]));
    const label = legend.appendChild(document.createElement('span'));
    const sign = label.appendChild(document.createElement('i'));
    sign.className = DASHES[i] ? 'stroke dashed' : 'stroke';
    sign.style.setProperty('--of', `var(--${colourOfRun(i)})`);
    label.append(run.name);
  });
  map.knowUp(poses);
  map.all();
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => map.restyle());
  return map;
}

showNumbers();
const curves = makeCurves();
at('zoom-in').addEventListener('click', () => curves.zoom(0.5));
at('zoom-out').addEventListener('click', () => curves.zoom(2));
at('zoom-all').addEventListener('click', () => curves.all());
let map = null;
try {
  map = showPaths();
} catch (error) {
  at('map').hidden = true;
  at('no-map').hidden = false;
}
