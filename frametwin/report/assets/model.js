/* The twin in 3D: all struts in one buffer, the plan as lines. */
const SIDES = 5;

/** Straight pieces of a curve as it is drawn. */
const piecesOf = (curves) => curves.degree > 3 ? 12 : 6;
class Model {
  constructor(stage, onPick) {
    this.stage = stage;
    this.onPick = onPick;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 1, 1000);
    this.camera.up.set(0, 0, 1);
    this.sky = new THREE.HemisphereLight(0xffffff, 0x8890a0, 2.1);
    this.lamp = new THREE.DirectionalLight(0xffffff, 1.3);
    this.camera.add(this.lamp);
    this.lamp.position.set(0.4, 0.8, 1);
    this.scene.add(this.sky, this.camera);
    stage.append(this.renderer.domElement);
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.draw());
    this.enlarge = 1;
    new ResizeObserver(() => this.resize()).observe(stage);
    let down = null;
    stage.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    stage.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5) this.pick(event);
      down = null;
    });
    stage.addEventListener("keydown", (event) => this.key(event));
  }

  /** Show a scene; the view stays unless it is the first. */
  show(scene, quantity, selected) {
    this.data = scene; this.quantity = quantity; this.selected = selected;
    const { plan, curves, truth } = opened(scene);
    this.clear();
    const count = scene.struts.length;
    this.shown = this.moved(scene, curves, plan);
    this.tubes = this.mesh(this.shown, scene.struts.map((strut) => plan.radius[strut]), count);
    this.scene.add(this.tubes);
    this.ghost = this.wires(plan.curves, plan.curves.length / 12, this.ghostColour(), 0.55);
    this.scene.add(this.ghost);
    this.ghost.visible = $("ghost").checked;
    this.knobs = this.octahedra(scene, this.shown, plan.radius);
    this.scene.add(this.knobs);
    if (truth) {
      this.truth = this.wires(this.moved(scene, truth, plan), count, OUTLINE.truth, 0.95);
      this.truth.visible = $("truth").checked;
      this.scene.add(this.truth);
    }
    this.paint();
    if (!this.framed) this.home();
    this.draw();
  }

  clear() {
    for (const item of [this.tubes, this.ghost, this.knobs, this.truth]) if (item) { this.scene.remove(item); item.geometry.dispose(); item.material.dispose(); }
    this.truth = null;
  }
  ghostColour() { return DARK.matches ? "#7b8594" : "#9aa3af"; }

  /** Curves with their way from the plan enlarged. */
  moved(scene, curves, plan) {
    if (this.enlarge === 1) return curves;
    const size = sizeOf(curves), out = Object.assign(new Float32Array(curves.length), { degree: curves.degree });
    scene.struts.forEach((strut, i) => {
      const planned = elevated(plan.curves, strut, curves.degree);
      for (let k = 0; k < size; k++) out[size * i + k] = planned[k] + this.enlarge * (curves[size * i + k] - planned[k]);
    });
    return out;
  }

  mesh(curves, radii, count) {
    const pieces = piecesOf(curves), rings = pieces + 1, per = rings * SIDES;
    const position = new Float32Array(count * per * 3), normal = new Float32Array(count * per * 3);
    const index = new Uint32Array(count * pieces * SIDES * 6), p = [0, 0, 0], q = [0, 0, 0];
    let at = 0;
    for (let i = 0; i < count; i++) {
      for (let ring = 0; ring < rings; ring++) {
        const u = ring / pieces;
        pointOn(curves, i, Math.max(0, u - 0.05), q); const a = [...q];
        pointOn(curves, i, Math.min(1, u + 0.05), q);
        let t = [q[0] - a[0], q[1] - a[1], q[2] - a[2]];
        const length = Math.hypot(...t) || 1; t = t.map((value) => value / length);
        const side = Math.abs(t[2]) < 0.85 ? [0, 0, 1] : [1, 0, 0];
        let n = [t[1] * side[2] - t[2] * side[1], t[2] * side[0] - t[0] * side[2], t[0] * side[1] - t[1] * side[0]];
        const size = Math.hypot(...n) || 1; n = n.map((value) => value / size);
        const b = [t[1] * n[2] - t[2] * n[1], t[2] * n[0] - t[0] * n[2], t[0] * n[1] - t[1] * n[0]];
        pointOn(curves, i, u, p);
        for (let s = 0; s < SIDES; s++) {
          const c = Math.cos((2 * Math.PI * s) / SIDES), d = Math.sin((2 * Math.PI * s) / SIDES), o = 3 * (i * per + ring * SIDES + s);
          for (let k = 0; k < 3; k++) { normal[o + k] = c * n[k] + d * b[k]; position[o + k] = p[k] + radii[i] * normal[o + k]; }
          if (ring < pieces) {
            const first = i * per + ring * SIDES + s, next = i * per + ring * SIDES + ((s + 1) % SIDES);
            index.set([first, next, first + SIDES, next, next + SIDES, first + SIDES], at); at += 6;
          }
        }
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(count * per * 3), 3));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
  }

  /** A knob at every end that is off its joint. */
  octahedra(scene, curves, radius) {
    const { place } = opened(scene), ends = scene.torn || [], position = [];
    for (const [strut, side] of ends) {
      const size = 2.5 * radius[strut], o = sizeOf(curves) * place.get(strut) + 3 * curves.degree * side;
      for (let face = 0; face < 8; face++) for (let k = 0; k < 3; k++) {
        const corner = [0, 0, 0];
        corner[k] = face & (1 << k) ? size : -size;
        position.push(...corner.map((value, j) => value + curves[o + j]));
      }
    }
    const geometry = new THREE.BufferGeometry(), [red, green, blue] = TORN.map((value) => value / 255);
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(position), 3));
    const colour = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace);
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: colour, side: THREE.DoubleSide }));
  }

  wires(curves, count, colour, opacity) {
    const pieces = piecesOf(curves), position = new Float32Array(count * pieces * 6), p = [0, 0, 0];
    for (let i = 0, o = 0; i < count; i++) for (let k = 0; k < pieces; k++) for (const u of [k / pieces, (k + 1) / pieces]) { pointOn(curves, i, u, p); position.set(p, o); o += 3; }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity, depthWrite: false }));
  }

  /** Give every strut its colour; the one that is looked at keeps it and the others fade. */
  paint() {
    const colours = this.tubes.geometry.getAttribute("color"), per = (piecesOf(this.shown) + 1) * SIDES, colour = new THREE.Color();
    this.data.struts.forEach((strut, i) => {
      const chosen = strut === this.selected;
      const rgb = chosen ? (DARK.matches ? [255, 255, 255] : [15, 18, 24]) : colourOf(this.data, this.quantity, i);
      colour.setRGB(rgb[0] / 255, rgb[1] / 255, rgb[2] / 255, THREE.SRGBColorSpace);
      for (let k = 0; k < per; k++) colours.setXYZ(i * per + k, colour.r, colour.g, colour.b);
    });
    colours.needsUpdate = true;
  }
  choose(strut) { this.selected = strut; this.paint(); this.draw(); }
  recolour(quantity) { this.quantity = quantity; this.paint(); this.draw(); }

  home() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity], { plan } = opened(this.data);
    for (let i = 0; i < plan.curves.length; i++) { low[i % 3] = Math.min(low[i % 3], plan.curves[i]); high[i % 3] = Math.max(high[i % 3], plan.curves[i]); }
    const radius = 0.5 * Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    const middle = new THREE.Vector3(...low.map((value, k) => 0.5 * (value + high[k])));
    const way = new THREE.Vector3(0.55, -0.78, 0.36).normalize();
    let away = (1.2 * radius) / Math.sin((Math.PI / 180) * 17.5);
    this.camera.near = away / 100; this.camera.far = away * 20;
    this.camera.updateProjectionMatrix();
    for (let k = 0; k < 8; k++) { // nearer until it fills the picture, and its middle in the middle
      this.look(middle, way, away);
      const [left, right, low, high] = this.spread(plan.curves, this.shown);
      const half = away * Math.tan((Math.PI / 180) * 17.5), matrix = this.camera.matrixWorld.elements;
      middle.addScaledVector(new THREE.Vector3(...matrix.slice(0, 3)), 0.5 * (left + right) * half * this.camera.aspect);
      middle.addScaledVector(new THREE.Vector3(...matrix.slice(4, 7)), 0.5 * (low + high) * half);
      away *= Math.min(2, Math.max(0.5, Math.max(right - left, high - low) / 1.72));
    }
    this.look(middle, way, away);
    this.framed = true;
    this.draw();
  }

  look(target, way, away) {
    this.camera.position.copy(target).addScaledVector(way, away);
    this.controls.target.copy(target);
    this.controls.update();
    this.camera.updateMatrixWorld();
  }

  /** Between which places of the picture, -1 to 1, the ends of curves lie: left, right, low, high. */
  spread(...groups) {
    const box = [Infinity, -Infinity, Infinity, -Infinity], v = new THREE.Vector3();
    for (const curves of groups) for (let i = 0; i < curves.length; i += 3) {
      v.set(curves[i], curves[i + 1], curves[i + 2]).project(this.camera);
      box[0] = Math.min(box[0], v.x); box[1] = Math.max(box[1], v.x); box[2] = Math.min(box[2], v.y); box[3] = Math.max(box[3], v.y);
    }
    return box;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height);
    const first = !this.sized;
    this.sized = true;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (first && this.data) this.home();
    this.draw();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.renderer.render(this.scene, this.camera); });
  }

  /** The strut nearest to the pointer within a finger's breadth, the nearer one to the eye where several are. */
  pick(event) {
    const box = this.stage.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top, v = new THREE.Vector3();
    const reach = event.pointerType === "touch" ? 22 : 12;
    let best = null;
    const p = [0, 0, 0];
    this.data.struts.forEach((strut, i) => {
      let before = null;
      for (let k = 0, pieces = piecesOf(this.shown); k <= pieces; k++) {
        pointOn(this.shown, i, k / pieces, p);
        v.set(...p).project(this.camera);
        const here = [((v.x + 1) / 2) * box.width, ((1 - v.y) / 2) * box.height, v.z];
        if (before && Math.abs(here[2]) < 1) {
          const d = [here[0] - before[0], here[1] - before[1]], size = d[0] ** 2 + d[1] ** 2 || 1;
          const u = Math.min(1, Math.max(0, ((x - before[0]) * d[0] + (y - before[1]) * d[1]) / size));
          const off = Math.hypot(before[0] + u * d[0] - x, before[1] + u * d[1] - y), score = off + 1500 * (here[2] + 1);
          if (off < reach && (!best || score < best.score)) best = { strut, score };
        }
        before = here;
      }
    });
    this.onPick(best ? best.strut : null);
  }

  turn(sideways, upwards) {
    const offset = this.camera.position.clone().sub(this.controls.target), radius = offset.length();
    const around = Math.atan2(offset.y, offset.x) + sideways;
    const tilt = Math.min(1.5, Math.max(-1.5, Math.asin(offset.z / radius) + upwards));
    offset.set(radius * Math.cos(tilt) * Math.cos(around), radius * Math.cos(tilt) * Math.sin(around), radius * Math.sin(tilt));
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.draw();
  }
  zoom(factor) {
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
    this.draw();
  }
  key(event) {
    const acts = {
      ArrowLeft: () => this.turn(-0.12, 0), ArrowRight: () => this.turn(0.12, 0), ArrowUp: () => this.turn(0, 0.12), ArrowDown: () => this.turn(0, -0.12),
      "+": () => this.zoom(0.87), "=": () => this.zoom(0.87), "-": () => this.zoom(1.15), Home: () => this.home(), ",": () => this.step(-1), ".": () => this.step(1), Escape: () => this.onPick(null),
    };
    if (acts[event.key] && !event.ctrlKey && !event.metaKey) { acts[event.key](); event.preventDefault(); }
  }
  step(way) {
    const { struts } = this.data, i = struts.indexOf(this.selected);
    if (struts.length) this.onPick(struts[i < 0 ? 0 : (i + way + struts.length) % struts.length]);
  }
}
