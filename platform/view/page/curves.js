// Curves over time, one below another with one axis: they are zoomed, pointed at and sought in together. A panel has series:
//   { kind: 'line' | 'share' | 'stack' | 'states', title, unit, least (of the axis' top), limit: { value, name }, series: [{ name, times, values, colour,
//     dash }] }
// Values are a number for each time (s, going up); NaN: a gap. 'share', 'stack': one on another, a
// share up to a hundred; 'states': 0 none to 3 tracked, as four rows, so that colour is not alone.
'use strict';

const CURVE_LEFT = 64;
const CURVE_RIGHT = 10;
const CURVE_ROWS = ['none', 'predicted', 'unsure', 'tracked'];

// The last index whose time is at most `time`; at least 0.
function indexAt(times, time) {
  let low = 0;
  let high = times.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  return low;
}

// A step of 1, 2 or 5 times a power of ten that cuts `range` into at most `count` parts.
function niceStep(range, count) {
  const raw = Math.max(range, 1e-9) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].find((factor) => raw <= factor * power * 1.000001) * power;
}

class Curves extends Drawing {
  // `onSeek(second)`: somebody chose a time; `onPoint(second or null)`: the pointer is over one.
  constructor(box, end_s, panels, { onSeek, onPoint }) {
    super();
    this.end = Math.max(end_s, 1e-3);
    this.from = 0;
    this.to = this.end;
    this.now = 0;
    this.over = null;
    this.marks = [];
    this.onSeek = onSeek;
    this.onPoint = onPoint;
    this.panels = panels.map((panel) => this.make(box, panel));
    new ResizeObserver(() => this.change()).observe(box);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.change());
    this.change();
  }

  make(box, panel) {
    const figure = document.createElement('figure');
    const title = figure.appendChild(document.createElement('figcaption'));
    const name = title.appendChild(document.createElement('b'));
    name.textContent = panel.title;
    if (panel.kind !== 'states') {
      for (const series of panel.series) title.append(this.swatch(series, panel.kind));
    }
    const canvas = figure.appendChild(document.createElement('canvas'));
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', `${panel.title} over time`);
    canvas.setAttribute('aria-describedby', 'curve-keys');
    canvas.style.height = `${panel.kind === 'states' ? 92 : 130}px`;
    box.append(figure);
    this.listen(canvas);
    return { ...panel, canvas };
  }
  swatch(series, kind) {
    const label = document.createElement('span');
    const sign = label.appendChild(document.createElement('i'));
    sign.className = kind === 'line' ? 'stroke' : 'swatch';
    sign.style.setProperty('--of', `var(--${series.colour})`);
    if (series.dash) sign.classList.add('dashed');
    label.append(series.name);
    return label;
  }

  // --- What is seen of the time --------------------------------------------------------------------------------------
  zoom(factor, centre = this.now) {
    const span = Math.min(this.end, Math.max(0.05, (this.to - this.from) * factor));
    const share = (centre - this.from) / (this.to - this.from);
    this.show(centre - share * span, centre - share * span + span);
  }
  show(from, to) {
    const span = Math.min(this.end, to - from);
    this.from = Math.min(Math.max(0, from), this.end - span);
    this.to = this.from + span;
    this.change();
  }
  all() {
    this.show(0, this.end);
  }
  setNow(second) {
    this.now = second;
    const span = this.to - this.from;
    if (second < this.from || second > this.to) this.show(second - span * 0.1, second + span * 0.9);
    this.change();
  }
  setMarks(seconds) {
    this.marks = seconds;
    this.change();
  }

  x(canvas, second) {
    return CURVE_LEFT + (canvas.clientWidth - CURVE_LEFT - CURVE_RIGHT) * (second - this.from) / (this.to - this.from);
  }
  second(canvas, x) {
    const share = (x - CURVE_LEFT) / (canvas.clientWidth - CURVE_LEFT - CURVE_RIGHT);
    return Math.min(this.end, Math.max(0, this.from + share * (this.to - this.from)));
  }

  listen(canvas) {
    let begin = null;
    canvas.addEventListener('pointerdown', (e) => {
      if (e.button !== 0) return;
      begin = e.offsetX;
      if (e.pointerType === 'mouse') canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener('pointermove', (e) => {
      this.over = this.second(canvas, e.offsetX);
      this.range = begin !== null && Math.abs(e.offsetX - begin) > 5 ? [this.second(canvas, begin), this.over].sort((a, b) => a - b) : null;
      this.onPoint(this.over);
      this.change();
    });
    canvas.addEventListener('pointerup', (e) => {
      if (this.range && this.range[1] - this.range[0] > 0.02) {
        this.show(...this.range);
      } else if (begin !== null) {
        this.onSeek(this.second(canvas, e.offsetX));
      }
      begin = this.range = null;
      this.change();
    });
    const leave = () => {
      begin = this.range = this.over = null;
      this.onPoint(null);
      this.change();
    };
    canvas.addEventListener('pointerleave', leave);
    canvas.addEventListener('pointercancel', leave);
    canvas.addEventListener('dblclick', () => this.all());
    canvas.addEventListener('wheel', (e) => {
      if (!e.ctrlKey && document.activeElement !== canvas) return;  // the page scrolls
      e.preventDefault();
      this.zoom(Math.exp(Math.sign(e.deltaY) * 0.25), this.second(canvas, e.offsetX));
    }, { passive: false });
    canvas.addEventListener('keydown', (e) => {
      const span = this.to - this.from;
      if (e.key === '+' || e.key === '=') this.zoom(0.7);
      else if (e.key === '-' || e.key === '_') this.zoom(1 / 0.7);
      else if (e.key === '0') this.all();
      else if (e.key === 'PageDown') this.show(this.from + span / 2, this.to + span / 2);
      else if (e.key === 'PageUp') this.show(this.from - span / 2, this.to - span / 2);
      else return;
      e.preventDefault();
    });
  }

  // --- Drawing -------------------------------------------------------------------------------------------------------
  draw() {
    const style = getComputedStyle(document.documentElement);
    this.colour = (name) => style.getPropertyValue('--' + name).trim();
    for (const panel of this.panels) this.drawPanel(panel);
  }

  drawPanel(panel) {
    const { canvas } = panel;
    const dots = Math.min(window.devicePixelRatio || 1, 2);
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    if (width === 0) return;
    canvas.width = Math.round(width * dots);
    canvas.height = Math.round(height * dots);
    const c = canvas.getContext('2d');
    c.scale(dots, dots);
    c.font = '12px system-ui, sans-serif';
    const area = { top: 6, bottom: height - 20, left: CURVE_LEFT, right: width - CURVE_RIGHT };
    const top = panel.kind === 'states' ? 3 : panel.kind === 'share' ? 100 : this.topOf(panel);
    const y = (value) => area.bottom - (area.bottom - area.top) * Math.min(1, Math.max(0, value / top));
    this.drawGrid(c, panel, area, top, y);
    c.save();
    c.beginPath();
    c.rect(area.left, 0, area.right - area.left, height);
    c.clip();
    if (panel.kind === 'states') this.drawStates(c, panel, area);
    else if (panel.kind === 'line') panel.series.forEach((series) => this.drawLine(c, canvas, series, y));
    else this.drawAreas(c, canvas, panel, y);
    if (panel.limit && panel.limit.value < top) this.drawLimit(c, area, y(panel.limit.value), panel.limit.name);
    this.drawTimes(c, canvas, panel, area);
    c.restore();
  }

  // The highest of what is seen, not of all: who zooms in sees small things.
  topOf(panel) {
    let top = 0;
    const { series } = panel;
    const last = (of) => Math.min(of.times.length - 1, indexAt(of.times, this.to));
    if (panel.kind === 'stack') {
      for (let i = indexAt(series[0].times, this.from); i <= last(series[0]); ++i) {
        top = Math.max(top, series.reduce((sum, { values }) => sum + values[i], 0));
      }
    } else {
      for (const one of series) {
        for (let i = indexAt(one.times, this.from); i <= last(one); ++i) if (one.values[i] > top) top = one.values[i];
      }
    }
    return Math.max(1.08 * top, panel.least || 1e-6);
  }

  drawGrid(c, panel, area, top, y) {
    c.strokeStyle = this.colour('line');
    c.fillStyle = this.colour('soft');
    c.lineWidth = 1;
    c.textAlign = 'right';
    c.textBaseline = 'middle';
    if (panel.kind === 'states') {
      CURVE_ROWS.forEach((name, i) => c.fillText(name, area.left - 6, this.rowOf(area, i) + 0.5));
    } else {
      const step = niceStep(top, 3);
      for (let i = 0; i * step <= top * 1.0001; ++i) {
        const at = Math.round(y(i * step)) + 0.5;
        c.beginPath();
        c.moveTo(area.left, at);
        c.lineTo(area.right, at);
        c.stroke();
        c.fillText(`${Number((i * step).toPrecision(6))} ${panel.unit}`, area.left - 6, at);
      }
    }
    c.textAlign = 'center';
    c.textBaseline = 'alphabetic';
    const step = niceStep(this.to - this.from, Math.max(2, (area.right - area.left) / 90));
    for (let i = Math.ceil(this.from / step); i * step <= this.to; ++i) {
      const x = this.x(panel.canvas, i * step);
      if (x < area.right - 12) c.fillText(`${Number((i * step).toPrecision(8))} s`, x, area.bottom + 15);
    }
  }

  rowOf(area, state) {
    return area.bottom - (state + 0.5) * (area.bottom - area.top) / 4;
  }
  drawStates(c, panel, area) {
    const { times, values } = panel.series[0];
    const high = (area.bottom - area.top) / 4 - 4;
    const last = indexAt(times, this.to);
    for (let i = indexAt(times, this.from); i <= last;) {
      let end = i + 1;
      while (end <= last && values[end] === values[i]) ++end;
      const x = this.x(panel.canvas, times[i]);
      const right = this.x(panel.canvas, end < times.length ? times[end] : this.end);
      c.fillStyle = this.colour(CURVE_ROWS[values[i]]);
      c.fillRect(x, this.rowOf(area, values[i]) - high / 2, Math.max(1.5, right - x), high);
      i = end;
    }
  }

  // For each column of pixels the least and the most of what falls into it.
  columns(canvas, { times, values }) {
    const columns = [];
    const last = Math.min(times.length - 1, indexAt(times, this.to) + 1);
    for (let i = indexAt(times, this.from); i <= last; ++i) {
      const x = Math.round(this.x(canvas, times[i]) * 2) / 2;
      const before = columns[columns.length - 1];
      const value = values[i];
      if (Number.isNaN(value)) columns.push(null);
      else if (before && before.x === x) {
        before.low = Math.min(before.low, value);
        before.high = Math.max(before.high, value);
      } else columns.push({ x, low: value, high: value });
    }
    return columns;
  }
  drawLine(c, canvas, series, y) {
    c.strokeStyle = this.colour(series.colour);
    c.lineWidth = 1.6;
    c.setLineDash(series.dash || []);
    c.beginPath();
    let isGap = true;
    for (const column of this.columns(canvas, series)) {
      if (column) {
        if (isGap) c.moveTo(column.x, y(column.low) + 0.5);
        c.lineTo(column.x, y(column.low));
        if (column.high > column.low) c.lineTo(column.x, y(column.high));
      }
      isGap = column === null;
    }
    c.stroke();
    c.setLineDash([]);
  }

  drawAreas(c, canvas, panel, y) {
    const { times } = panel.series[0];
    const last = Math.min(times.length - 1, indexAt(times, this.to) + 1);
    const first = indexAt(times, this.from);
    const stride = Math.max(1, Math.floor((last - first) / (2 * canvas.clientWidth)));
    const xs = [];
    for (let i = first; i <= last; i += stride) xs.push(i);
    let below = xs.map(() => 0);
    panel.series.forEach((series) => {
      const above = xs.map((i, k) => {
        let most = 0;
        for (let j = i; j < Math.min(i + stride, last + 1); ++j) most = Math.max(most, series.values[j] || 0);
        return panel.kind === 'share' ? Math.min(100, below[k] + most) : below[k] + most;
      });
      c.beginPath();
      xs.forEach((i, k) => c.lineTo(this.x(canvas, times[i]), y(above[k])));
      for (let k = xs.length - 1; k >= 0; --k) c.lineTo(this.x(canvas, times[xs[k]]), y(below[k]));
      c.closePath();
      c.fillStyle = this.colour(series.colour);
      c.fill();
      c.strokeStyle = this.colour('card');
      c.lineWidth = 0.75;
      c.stroke();
      below = above;
    });
  }

  drawLimit(c, area, at, name) {
    c.strokeStyle = c.fillStyle = this.colour('ink');
    c.setLineDash([6, 4]);
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(area.left, at);
    c.lineTo(area.right, at);
    c.stroke();
    c.setLineDash([]);
    c.textAlign = 'right';
    const wide = c.measureText(name).width;
    c.fillStyle = this.colour('card');
    c.fillRect(area.right - wide - 8, at - 16, wide + 8, 15);
    c.fillStyle = this.colour('ink');
    c.fillText(name, area.right - 4, at - 4);
  }

  drawTimes(c, canvas, panel, area) {
    if (panel.kind === 'states') {
      c.fillStyle = this.colour('ink');
      for (const second of this.marks) {
        const x = this.x(canvas, second);
        c.beginPath();
        c.moveTo(x - 5, 0);
        c.lineTo(x + 5, 0);
        c.lineTo(x, 9);
        c.fill();
        c.fillRect(x - 0.5, 0, 1, area.bottom);
      }
    }
    if (this.range) {
      c.fillStyle = this.colour('ink');
      c.globalAlpha = 0.15;
      const [from, to] = this.range.map((second) => this.x(canvas, second));
      c.fillRect(from, area.top, to - from, area.bottom - area.top);
      c.globalAlpha = 1;
    }
    c.strokeStyle = this.colour('ink');
    const upright = (second, dash) => {
      const x = Math.round(this.x(canvas, second)) + 0.5;
      c.setLineDash(dash);
      c.lineWidth = 1.5;
      c.beginPath();
      c.moveTo(x, 0);
      c.lineTo(x, area.bottom);
      c.stroke();
      c.setLineDash([]);
    };
    upright(this.now, []);
    if (this.over !== null) upright(this.over, [3, 3]);
  }
}
