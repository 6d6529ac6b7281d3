// The camera's picture with the mesh over it, on the canvas `camera`; the boxes of the legend say which layers.
'use strict';

// Groups that agree with the pose are blue, those that move against it orange, others grey; neighbours differ in tint, and
// each has a letter.
const STATIC_COLOUR = '#56b4e9';
const MOVING_COLOUR = '#ffb000';
const RIVAL_COLOUR = '#ff9be0';
const TINTS = { still: [STATIC_COLOUR, '#9fd8ff', '#3d8fd6'], moving: [MOVING_COLOUR, '#ff8340', '#ffd980'], unknown: ['#c8c8c8', '#8f8f8f'] };

// What became of a feature (0: neither, 1: static, 2: moving), and whether only the rival of the motion chosen explains it.
const kindOf = (bits) => bits & 3;
const isRivalAlone = (bits) => (bits >> 2) === 2;

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
    g.still += kindOf(features[i + 3]) === 1 ? 1 : 0;
    g.moving += kindOf(features[i + 3]) === 2 ? 1 : 0;
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
  const rival = new Path2D();
  const r = 1.6 * unit;
  const counts = [0, 0, 0];
  let rivals = 0;
  for (let i = 0; i < features.length; i += 4) {
    const x = features[i] * scale;
    const y = features[i + 1] * scale;
    const kind = kindOf(features[i + 3]);
    counts[kind] += 1;
    if (isRivalAlone(features[i + 3])) {
      rivals += 1;
      rival.moveTo(x, y - 3.2 * r);
      rival.lineTo(x + 2.8 * r, y + 1.7 * r);
      rival.lineTo(x - 2.8 * r, y + 1.7 * r);
      rival.closePath();
    }
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
  const outline = (path, width, colour) => {
    context.lineWidth = 3.4 * unit;
    context.strokeStyle = '#000000c0';
    context.stroke(path);
    context.lineWidth = width * unit;
    context.strokeStyle = colour;
    context.stroke(path);
  };
  if (at('show-moving').checked) outline(moving, 1.8, MOVING_COLOUR);
  if (at('show-rival').checked) outline(rival, 1.5, RIVAL_COLOUR);
  setText('n-rival', String(rivals));
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

// `shown`: { image: [width, height] of the camera, picture, features, kept, cut }.
function drawCamera(shown) {
  if (!shown || !shown.picture) return;
  const canvas = at('camera');
  const [width, height] = shown.image;
  const dots = Math.min(window.devicePixelRatio || 1, 2);
  const wide = Math.max(1, Math.round(canvas.clientWidth * dots));
  const high = Math.round(wide * height / width);
  if (canvas.width !== wide || canvas.height !== high) {
    canvas.width = wide;
    canvas.height = high;
    canvas.style.aspectRatio = `${width} / ${height}`;
  }
  const context = canvas.getContext('2d');
  context.drawImage(shown.picture, 0, 0, wide, high);
  const scale = wide / width / 8;  // coordinates are eighths of a pixel
  const { ordered, colourAt } = groupsOf(shown.features);
  if (at('show-kept').checked) {
    context.setLineDash([]);
    context.lineWidth = 1.1 * dots;
    context.globalAlpha = 0.75;
    drawEdges(context, shown.kept, scale, (x0, y0, x1, y1) =>
      colourAt(x0, y0) || colourAt(x1, y1) || TINTS.unknown[0]);
  }
  if (at('show-cut').checked) {
    context.setLineDash([3 * dots, 3 * dots]);
    context.lineWidth = 1.3 * dots;
    context.globalAlpha = 0.9;
    drawEdges(context, shown.cut, scale, () => MOVING_COLOUR);
  }
  context.globalAlpha = 1;
  drawFeatures(context, shown.features, scale, dots);
  if (at('show-kept').checked) nameGroups(context, ordered, scale, dots);
}
