/* Photographs with what the twin, the plan and the truth say drawn over them. */
/** Chords of a curve as it is drawn. */
const stepsOf = (curves) => curves.degree > 3 ? 20 : 10;

/** Pixels of points of a curve in a picture, and the strut's width there. */
function projected(picture, curves, i, radius) {
  const [fx, fy, cx, cy] = picture.k, m = picture.m, p = [0, 0, 0], points = [], steps = stepsOf(curves);
  let width = 0;
  for (let k = 0; k <= steps; k++) {
    pointOn(curves, i, k / steps, p);
    const z = m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11];
    if (z <= 0) return null;
    points.push([(fx * (m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3])) / z + cx, (fy * (m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7])) / z + cy]);
    width += (2 * radius * fx) / z / (steps + 1);
  }
  return { points, width };
}

/** Draw the outline of all struts together: all of them wide, then their insides out again. */
function outline(context, size, zoom, chains, colour, thin) {
  const layer = document.createElement("canvas");
  [layer.width, layer.height] = [context.canvas.width, context.canvas.height];
  const pen = layer.getContext("2d");
  pen.scale(zoom, zoom);
  pen.lineCap = pen.lineJoin = "round";
  for (const [more, mode] of [[thin, "source-over"], [-thin, "destination-out"]]) {
    pen.globalCompositeOperation = mode;
    pen.strokeStyle = colour;
    for (const { points, width } of chains) {
      if (width + more <= 0.2) continue;
      pen.lineWidth = width + more;
      pen.beginPath();
      points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.stroke();
    }
  }
  context.drawImage(layer, 0, 0);
}

/** A picture with what is over it. */
function shot(picture, scene, options) {
  const [width, height] = picture.size;
  const box = make("button", { type: "button", class: "shot", "aria-label": options.label, style: `aspect-ratio:${width}/${height};--aspect:${width / height}` });
  box.append(make("img", { src: `data:image/jpeg;base64,${picture.picture}`, alt: "", width, height, loading: "lazy" }));
  const canvas = make("canvas");
  box.append(canvas);
  const redraw = () => {
    const shown = box.clientWidth * Math.min(window.devicePixelRatio, 2);
    if (!shown) return;
    canvas.width = shown; canvas.height = (shown * height) / width;
    const zoom = shown / width, context = canvas.getContext("2d"), { plan, curves, truth } = opened(scene);
    const radius = (strut) => plan.radius[strut], all = scene.struts.map((strut, i) => [strut, i]);
    const fine = Math.min(2, devicePixelRatio) * 1.3 / zoom;
    const layers = [["plan", (s) => projected(picture, plan.curves, s[0], radius(s[0]))], ["truth", (s) => truth && projected(picture, truth, s[1], radius(s[0]))], ["twin", (s) => projected(picture, curves, s[1], radius(s[0]))]];
    for (const [name, of] of layers) {
      if (!LAYERS[name]) continue;
      const struts = options.only !== undefined && name !== "twin" ? all.filter((s) => s[0] === options.only) : all;
      context.globalAlpha = options.only !== undefined && name === "twin" ? 0.45 : 1;
      outline(context, picture.size, zoom, struts.map(of).filter(Boolean), OUTLINE[name], fine);
    }
    context.globalAlpha = 1;
    const chosen = options.only ?? chosenStrut;
    const i = opened(scene).place.get(chosen);
    if (i !== undefined && LAYERS.twin) { const chain = projected(picture, curves, i, radius(chosen)); if (chain) outline(context, picture.size, zoom, [chain], options.only !== undefined ? OUTLINE.twin : "#ffe14d", fine * 1.6); }
  };
  new ResizeObserver(redraw).observe(box);
  box.redraw = redraw;
  SHOTS.push(box);
  box.addEventListener("click", () => options.onclick ? options.onclick() : box.classList.toggle("grown"));
  return box;
}
const SHOTS = [], LAYERS = { plan: false, truth: false, twin: true };
const redrawShots = () => SHOTS.forEach((box) => box.redraw());
