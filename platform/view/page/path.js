// The path in the map: coloured by state, with gaps where nothing is known between two places; other lines beside it (a true
// path, another run's); a mark; and which place lies under a finger.
'use strict';

const STATE_NAMES = ['none', 'predicted', 'unsure', 'tracked'];
const GAP = 8;  // added to a place's state: no line leads here from the place before

class MapPath {
  constructor(root) {
    this.root = root;
    this.places = [];  // [x, y, z, state]
    const colours = { vertexColors: THREE.VertexColors };
    this.line = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ ...colours, linewidth: 2 }));
    this.dots = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ ...colours, size: 2.5, sizeAttenuation: false }));
    this.marked = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size: 13, sizeAttenuation: false }));
    this.lines = new Map();  // name -> { object, colour }
    for (const object of [this.line, this.dots, this.marked]) {
      object.frustumCulled = false;
      root.add(object);
    }
    this.marked.visible = false;
  }

  clear() {
    this.places = [];
    for (const line of this.lines.values()) {
      this.root.remove(line.object);
      line.object.geometry.dispose();
    }
    this.lines.clear();
    this.setMark(null);
    this.draw();
  }
  add(begin, places) {
    this.places.length = begin;
    for (const place of places) this.places.push(place);
    this.draw();
  }

  restyle(colours, colourOf) {
    this.colours = colours;
    this.colourOf = colourOf;
    this.marked.material.color = colourOf('ink');
    for (const line of this.lines.values()) line.object.material.color = colourOf(line.colour);
    this.draw();
  }

  draw() {
    const dots = new Float32Array(3 * this.places.length);
    const dotColours = new Float32Array(dots.length);
    const segments = [];
    const colours = [];
    this.places.forEach((place, i) => {
      const colour = this.colours[STATE_NAMES[place[3] % GAP] || 'none'];
      dots.set(place.slice(0, 3), 3 * i);
      dotColours.set([colour.r, colour.g, colour.b], 3 * i);
      if (i === 0 || place[3] >= GAP) return;
      const before = this.places[i - 1];
      segments.push(before[0], before[1], before[2], place[0], place[1], place[2]);
      colours.push(colour.r, colour.g, colour.b, colour.r, colour.g, colour.b);
    });
    replaceGeometry(this.dots, dots, dotColours);
    replaceGeometry(this.line, new Float32Array(segments), new Float32Array(colours));
  }

  // Points x, y, z one after the other; NaN: a gap. `colour`: a name of the style sheet's. `isDashed`: every second piece of it.
  setLine(name, points, colour, isDashed) {
    const ends = [];
    for (let i = 3; i < points.length; i += 3) {
      if (Number.isNaN(points[i] + points[i - 3]) || (isDashed && i / 3 % 6 >= 3)) continue;
      ends.push(points[i - 3], points[i - 2], points[i - 1], points[i], points[i + 1], points[i + 2]);
    }
    let line = this.lines.get(name);
    if (!line) {
      line = { object: new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial()), colour };
      line.object.frustumCulled = false;
      line.points = points;
      this.lines.set(name, line);
      this.root.add(line.object);
    }
    line.object.material.color = this.colourOf(colour);
    replaceGeometry(line.object, new Float32Array(ends));
  }

  setMark(place) {
    this.marked.visible = Boolean(place);
    if (place) replaceGeometry(this.marked, new Float32Array(place.slice(0, 3)));
  }

  grow(box, quaternion) {
    const at = new THREE.Vector3();
    for (const place of this.places) box.expandByPoint(at.set(place[0], place[1], place[2]).applyQuaternion(quaternion));
    for (const line of this.lines.values()) {
      for (let i = 0; i < line.points.length; i += 3) {
        if (Number.isNaN(line.points[i])) continue;
        box.expandByPoint(at.set(line.points[i], line.points[i + 1], line.points[i + 2]).applyQuaternion(quaternion));
      }
    }
  }

  // The index of the place nearest to a point of the canvas (px), within 24 px; -1: none.
  pick(x, y, eye, canvas) {
    const at = new THREE.Vector3();
    let best = -1;
    let least = 24;
    this.places.forEach((place, i) => {
      at.set(place[0], place[1], place[2]).applyMatrix4(this.root.matrixWorld).project(eye);
      if (at.z > 1) return;
      const away = Math.hypot((at.x + 1) / 2 * canvas.clientWidth - x, (1 - at.y) / 2 * canvas.clientHeight - y);
      if (away >= least) return;
      least = away;
      best = i;
    });
    return best;
  }
}

// A few lines of some width, with square ends: a browser's own are a pixel wide. They are strips that are turned to the eye
// whenever it has moved.
class BoldLines {
  constructor(root) {
    this.root = root;
    this.ends = new Float32Array(0);
    this.strips = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    this.dots = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size: 8, sizeAttenuation: false }));
    for (const object of [this.strips, this.dots]) {
      object.frustumCulled = false;
      object.material.depthTest = false;  // seen through points and keyframes
      object.renderOrder = 1;
      root.add(object);
    }
  }
  setColour(colour) {
    this.strips.material.color = this.dots.material.color = colour;
  }
  // x, y, z of one end and the other, line by line.
  set(ends) {
    this.ends = ends;
    replaceGeometry(this.dots, ends);
  }
  // `height`: of the canvas, px.
  face(eye, height) {
    const WIDTH = 4;  // px
    const from = this.root.worldToLocal(eye.position.clone());
    const perMetre = WIDTH / height * Math.tan(eye.fov / 2 * Math.PI / 180);
    const corners = [];
    for (let i = 0; i < this.ends.length; i += 6) {
      const a = new THREE.Vector3().fromArray(this.ends, i);
      const b = new THREE.Vector3().fromArray(this.ends, i + 3);
      const side = b.clone().sub(a).cross(from.clone().sub(a)).normalize();
      const at = (end, sign) => end.clone().addScaledVector(side, sign * perMetre * end.distanceTo(from)).toArray();
      const [a0, a1, b0, b1] = [at(a, -1), at(a, 1), at(b, -1), at(b, 1)];
      corners.push(...a0, ...a1, ...b0, ...b0, ...a1, ...b1);
    }
    replaceGeometry(this.strips, new Float32Array(corners));
  }
}

function setAttribute(geometry, name, values) {
  const made = new THREE.BufferAttribute(values, 3);
  if (geometry.setAttribute) geometry.setAttribute(name, made); else geometry.addAttribute(name, made);
}
function replaceGeometry(object, positions, colours) {
  object.geometry.dispose();
  object.geometry = new THREE.BufferGeometry();
  setAttribute(object.geometry, 'position', positions);
  if (colours) setAttribute(object.geometry, 'color', colours);
}
