// The map in three dimensions: what keyframes saw to stand still, the path, the keyframes, what links them, and the camera. Drawn when something
// has changed, and not before. The scene hangs under `root`, which turns the map so that the camera's "up" points up.
'use strict';

class MapView extends Drawing {
  // `onPick`: somebody pressed on a place of the path, by its index; may be left out.
  constructor(canvas, onFollow, onPick) {
    super();
    this.canvas = canvas;
    this.onFollow = onFollow;
    this.onPick = onPick;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.scene = new THREE.Scene();
    this.eye = new THREE.PerspectiveCamera(50, 4 / 3, 0.02, 500);
    this.root = new THREE.Group();
    this.scene.add(this.root);
    this.clouds = new Map();  // keyframe -> Points
    this.keyframes = new Map();  // keyframe -> [x, y, z, qx, qy, qz, qw]
    this.path = new MapPath(this.root);
    this.up = new THREE.Vector3(0, -1, 0);
    this.target = new THREE.Vector3();
    this.turn = { azimuth: -0.6, height: 0.5, distance: 3.2 };
    this.follow = true;
    this.pose = null;
    this.floor = -1;
    this.points = 0;
    this.makeThings();
    this.grid.position.y = this.floor;
    this.listen();
    this.restyle();
    new ResizeObserver(() => this.change()).observe(canvas);
  }

  // --- What is shown -------------------------------------------------------------------------------------------------
  makeThings() {
    const lines = (width) => {
      const object = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ linewidth: width }));
      object.frustumCulled = false;
      return object;
    };
    this.keyframeLines = lines(1);
    this.covisibleLines = lines(1);
    this.covisibleLines.material.transparent = true;
    this.covisibleLines.material.opacity = 0.3;
    this.covisibleLines.material.depthWrite = false;
    this.loops = new BoldLines(this.root);
    this.cameraLines = lines(2);
    this.cameraFace = new THREE.Mesh(new THREE.BufferGeometry(),
      new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.3, side: THREE.DoubleSide, depthWrite: false }));
    this.cameraFace.frustumCulled = false;
    // A metre a piece: long lines that end behind the eye are not drawn everywhere.
    const ends = [];
    for (let i = -10; i <= 10; ++i) {
      for (let k = -10; k < 10; ++k) ends.push(i, 0, k, i, 0, k + 1, k, 0, i, k + 1, 0, i);
    }
    this.grid = lines(1);
    replaceGeometry(this.grid, new Float32Array(ends));
    this.scene.add(this.grid);
    this.root.add(this.covisibleLines, this.keyframeLines, this.cameraLines, this.cameraFace);
    this.material = new THREE.PointsMaterial({ vertexColors: THREE.VertexColors, size: 3, sizeAttenuation: false });
  }

  restyle() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => new THREE.Color(style.getPropertyValue('--' + name).trim());
    this.colours = { none: colour('none'), predicted: colour('predicted'), unsure: colour('unsure'), tracked: colour('tracked') };
    this.isDark = matchMedia('(prefers-color-scheme: dark)').matches;
    this.keyframeLines.material.color = colour('none');
    this.covisibleLines.material.color = colour('ink');
    this.loops.setColour(colour('loop'));
    this.grid.material.color = colour('grid');
    for (const cloud of this.clouds.values()) this.paint(cloud);
    this.path.restyle(this.colours, colour);
    this.change();
  }

  clear() {
    for (const cloud of this.clouds.values()) this.drop(cloud);
    this.clouds.clear();
    this.keyframes.clear();
    this.path.clear();
    this.pose = null;
    this.points = 0;
    this.upCount = 0;
    this.target.set(0, 0, 0);
    this.drawKeyframes();
    this.setLinks([], [], []);
  }

  // Eight bytes a point: x, y, z in mm, grey.
  addCloud(id, numbers) {
    if (this.clouds.has(id)) return;
    const count = numbers.length / 4;
    const positions = new Float32Array(3 * count);
    const grey = new Uint8Array(count);
    for (let i = 0; i < count; ++i) {
      for (let k = 0; k < 3; ++k) positions[3 * i + k] = numbers[4 * i + k] / 1000;
      grey[i] = numbers[4 * i + 3];
    }
    const geometry = new THREE.BufferGeometry();
    setAttribute(geometry, 'position', positions);
    const cloud = new THREE.Points(geometry, this.material);
    cloud.matrixAutoUpdate = false;
    cloud.frustumCulled = false;
    cloud.visible = false;  // until its keyframe's place is known
    cloud.userData = { grey, count, wasListed: false };
    this.paint(cloud);
    this.clouds.set(id, cloud);
    this.root.add(cloud);
  }

  // Brightness as the picture's, within what is seen on the ground.
  paint(cloud) {
    const { grey, count } = cloud.userData;
    const colours = new Float32Array(3 * count);
    for (let i = 0; i < count; ++i) {
      const share = grey[i] / 255;
      const value = this.isDark ? 0.35 + 0.65 * share : 0.1 + 0.55 * share;
      colours.fill(value, 3 * i, 3 * i + 3);
    }
    setAttribute(cloud.geometry, 'color', colours);
  }

  drop(cloud) {
    this.root.remove(cloud);
    cloud.geometry.dispose();
  }

  // `listed`: [[id, pose]], the whole map. Points follow their keyframe, and go with it.
  setKeyframes(listed) {
    this.keyframes = new Map(listed.map(([id, pose]) => [id, pose]));
    this.points = 0;
    for (const [id, cloud] of this.clouds) {
      const pose = this.keyframes.get(id);
      cloud.visible = pose !== undefined;
      if (pose) {
        cloud.userData.wasListed = true;
        cloud.matrix.compose(new THREE.Vector3(pose[0], pose[1], pose[2]),
          new THREE.Quaternion(pose[3], pose[4], pose[5], pose[6]), new THREE.Vector3(1, 1, 1));
        cloud.matrixWorldNeedsUpdate = true;
        this.points += cloud.userData.count;
      } else if (cloud.userData.wasListed) {
        this.drop(cloud);
        this.clouds.delete(id);
      }
    }
    this.canvas.dataset.points = this.points;
    this.drawKeyframes();
    this.findFloor();
    this.change();
  }

  // `covisible`, `loops`: pairs of places in `listed`, one after the other.
  setLinks(listed, covisible, loops) {
    const ends = (pairs) => {
      const made = new Float32Array(3 * pairs.length);
      for (let i = 0; i < pairs.length; ++i) made.set(listed[pairs[i]][1].slice(0, 3), 3 * i);
      return made;
    };
    replaceGeometry(this.covisibleLines, ends(covisible));
    this.loops.set(ends(loops));
    this.canvas.dataset.links = covisible.length / 2;
    this.canvas.dataset.loops = loops.length / 2;
    this.change();
  }
  showLinks(isShown) {
    this.covisibleLines.visible = isShown;
    this.change();
  }

  addPlaces(begin, places) {
    this.path.add(begin, places);
    this.change();
  }

  setPose(pose, state, aspect) {
    this.aspect = aspect;
    this.pose = pose || this.pose;
    this.state = state;
    if (pose) {
      const isFirst = !this.upCount;
      if (!this.isUpKnown) this.learnUp(pose);
      if (isFirst) this.turn.azimuth = this.azimuthBehind() + 0.5;
    }
    this.drawCamera();
    if (this.follow && this.pose) this.goTo();
    this.change();
  }

  // All poses are known: what is up does not change from here on.
  knowUp(poses) {
    this.isUpKnown = false;
    this.upCount = 0;
    for (const pose of poses) this.learnUp(pose);
    this.isUpKnown = poses.length > 0;
  }

  // Where the camera's "up" points on average is up.
  learnUp(pose) {
    const up = new THREE.Vector3(0, -1, 0).applyQuaternion(new THREE.Quaternion(pose[3], pose[4], pose[5], pose[6]));
    this.upCount = Math.min((this.upCount || 0) + 1, 200);
    this.up.multiplyScalar(1 - 1 / this.upCount).addScaledVector(up, 1 / this.upCount);
    // First a half turn about x, as for a camera held level (y down to y up), then what little is left: the shortest turn
    // between nearly opposite directions would have any axis.
    const half = new THREE.Quaternion(1, 0, 0, 0);
    this.root.quaternion.setFromUnitVectors(this.up.clone().applyQuaternion(half).normalize(), new THREE.Vector3(0, 1, 0))
      .multiply(half);
    this.root.updateMatrixWorld(true);
  }

  // The floor is where nearly nothing lies below.
  findFloor() {
    const heights = [];
    const at = new THREE.Vector3();
    for (const cloud of this.clouds.values()) {
      if (!cloud.visible) continue;
      cloud.updateMatrixWorld(true);
      const positions = cloud.geometry.attributes.position;
      for (let i = 0; i < positions.count; i += 7) heights.push(at.fromBufferAttribute(positions, i).applyMatrix4(cloud.matrixWorld).y);
    }
    if (heights.length < 20) return;
    heights.sort((a, b) => a - b);
    this.floor = heights[Math.floor(heights.length * 0.02)];
    this.grid.position.y = this.floor;
  }

  // A pyramid from the camera's centre to the corners of its picture, as pairs of ends.
  pyramid(pose, size, to) {
    const q = new THREE.Quaternion(pose[3], pose[4], pose[5], pose[6]);
    const corner = (x, y) => new THREE.Vector3(x * size, y * size * (this.aspect || 0.75), size).applyQuaternion(q)
      .add(new THREE.Vector3(pose[0], pose[1], pose[2]));
    const corners = [corner(-0.6, -0.6), corner(0.6, -0.6), corner(0.6, 0.6), corner(-0.6, 0.6)];
    corners.forEach((c, i) => {
      const next = corners[(i + 1) % 4];
      to.push(pose[0], pose[1], pose[2], c.x, c.y, c.z, c.x, c.y, c.z, next.x, next.y, next.z);
    });
    return corners;
  }

  drawKeyframes() {
    const ends = [];
    for (const pose of this.keyframes.values()) this.pyramid(pose, 0.06, ends);
    replaceGeometry(this.keyframeLines, new Float32Array(ends));
  }

  drawCamera() {
    if (!this.pose) return;
    const colour = this.colours[this.state] || this.colours.none;
    const ends = [];
    const [a, b, c, d] = this.pyramid(this.pose, 0.25, ends);
    replaceGeometry(this.cameraLines, new Float32Array(ends));
    const top = this.pose;  // its face, and a roof that says where up is
    const face = [a, b, c, a, c, d].flatMap((v) => [v.x, v.y, v.z]).concat([top[0], top[1], top[2], a.x, a.y, a.z, b.x, b.y, b.z]);
    replaceGeometry(this.cameraFace, new Float32Array(face));
    this.cameraLines.material.color = this.cameraFace.material.color = colour;
  }

  // --- The eye -------------------------------------------------------------------------------------------------------
  ahead(metres) {
    return new THREE.Vector3(0, 0, metres).applyQuaternion(new THREE.Quaternion(...this.pose.slice(3)));
  }
  azimuthBehind() {
    const ahead = this.ahead(1).applyQuaternion(this.root.quaternion);
    return Math.atan2(-ahead.x, -ahead.z);
  }
  // What is looked at lies a little before the camera.
  goTo() {
    const at = this.ahead(0.7).add(new THREE.Vector3(...this.pose.slice(0, 3))).applyQuaternion(this.root.quaternion);
    this.target.lerp(at, this.target.lengthSq() === 0 ? 1 : 0.1);
  }
  setFollow(follow) {
    this.follow = follow;
    this.onFollow(follow);
  }
  fromAbove() {
    this.turn = { azimuth: 0, height: 1.55, distance: Math.max(this.turn.distance, 5) };
    this.change();
  }
  fromBehind() {
    if (this.pose) this.turn = { azimuth: this.azimuthBehind(), height: 0.35, distance: 2.6 };
    this.setFollow(true);
    this.change();
  }
  all() {
    const box = new THREE.Box3();
    const at = new THREE.Vector3();
    this.path.grow(box, this.root.quaternion);
    for (const cloud of this.clouds.values()) {
      if (cloud.visible) box.expandByObject(cloud);
    }
    if (box.isEmpty()) return;
    this.setFollow(false);
    box.getCenter(this.target);
    this.turn.distance = Math.min(60, Math.max(1, box.getSize(at).length() * 0.75));
    this.change();
  }
  rotate(right, down) {
    this.turn.azimuth -= right;
    this.turn.height = Math.min(1.55, Math.max(-0.3, this.turn.height + down));
    this.change();
  }
  move(right, down) {
    this.setFollow(false);
    const scale = this.turn.distance * 0.9;
    const x = new THREE.Vector3().setFromMatrixColumn(this.eye.matrixWorld, 0);
    const y = new THREE.Vector3().setFromMatrixColumn(this.eye.matrixWorld, 1);
    this.target.addScaledVector(x, -right * scale).addScaledVector(y, down * scale);
    this.change();
  }
  come(factor) {
    this.turn.distance = Math.min(100, Math.max(0.3, this.turn.distance * factor));
    this.change();
  }

  listen() {
    const canvas = this.canvas;
    const fingers = new Map();
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, d: Math.hypot(a.x - b.x, a.y - b.y) };
    };
    canvas.addEventListener('pointerdown', (e) => {
      canvas.setPointerCapture(e.pointerId);
      fingers.set(e.pointerId, {
        x: e.clientX, y: e.clientY, button: e.button, way: 0, turns: e.pointerType === 'touch' ? null : true,
      });
    });
    canvas.addEventListener('pointermove', (e) => {
      const finger = fingers.get(e.pointerId);
      if (!finger) return;
      const before = fingers.size === 2 ? spread() : null;
      const dx = (e.clientX - finger.x) / canvas.clientHeight;
      const dy = (e.clientY - finger.y) / canvas.clientHeight;
      finger.way += Math.hypot(e.clientX - finger.x, e.clientY - finger.y);
      finger.x = e.clientX;
      finger.y = e.clientY;
      // A finger that begins up or down scrolls the page, and turns nothing.
      if (finger.turns === null && finger.way > 8) finger.turns = Math.abs(dx) > Math.abs(dy);
      if (!before && !finger.turns) return;
      if (before) {
        const after = spread();
        this.move((after.x - before.x) / canvas.clientHeight, (after.y - before.y) / canvas.clientHeight);
        if (before.d > 0 && after.d > 0) this.come(before.d / after.d);
      } else if (finger.button === 2 || e.shiftKey) {
        this.move(dx, dy);
      } else {
        this.rotate(4 * dx, 4 * dy);
      }
    });
    canvas.addEventListener('pointerup', (e) => {
      const finger = fingers.get(e.pointerId);
      fingers.delete(e.pointerId);
      if (!this.onPick || !finger || finger.way > 4) return;
      const box = canvas.getBoundingClientRect();
      const index = this.path.pick(e.clientX - box.left, e.clientY - box.top, this.eye, canvas);
      if (index >= 0) this.onPick(index);
    });
    canvas.addEventListener('pointercancel', (e) => fingers.delete(e.pointerId));
    // One finger up or down scrolls the page (view.css); two are the map's.
    canvas.addEventListener('touchstart', (e) => { if (e.touches.length > 1) e.preventDefault(); }, { passive: false });
    canvas.addEventListener('contextmenu', (e) => e.preventDefault());
    canvas.addEventListener('wheel', (e) => {
      e.preventDefault();
      this.come(Math.exp(Math.sign(e.deltaY) * 0.12));
    }, { passive: false });
    canvas.addEventListener('keydown', (e) => {
      const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      if (arrows[e.key]) {
        const [x, y] = arrows[e.key];
        if (e.shiftKey) this.move(-0.06 * x, -0.06 * y); else this.rotate(0.12 * x, 0.12 * y);
      } else if (e.key === '+' || e.key === '=') {
        this.come(0.85);
      } else if (e.key === '-' || e.key === '_') {
        this.come(1.18);
      } else if (e.key === 'Home') {
        this.all();
      } else {
        return;
      }
      e.preventDefault();
    });
  }

  draw() {
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.eye.aspect = width / height;
    this.eye.updateProjectionMatrix();
    const { azimuth, height: up, distance } = this.turn;
    this.eye.position.set(Math.sin(azimuth) * Math.cos(up), Math.sin(up), Math.cos(azimuth) * Math.cos(up))
      .multiplyScalar(distance).add(this.target);
    this.eye.lookAt(this.target);
    this.eye.updateMatrixWorld();
    this.loops.face(this.eye, height);
    this.renderer.render(this.scene, this.eye);
  }
}
