/* Charts, drawn as SVG. */
const WIDE = 380, HIGH = 185, LEFT = 48, RIGHT = 12, TOP = 10, BOTTOM = 38;

function ticks(low, high, count = 4) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw || 1));
  const step = [1, 2, 5, 10].map((k) => k * power).find((value) => value >= raw);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-6; value += step) found.push(value);
  return found;
}

/** Axes with their ticks and titles; gives the drawing and how values are placed. */
function axes(label, x, y, { log = false, whole = false } = {}) {
  const place = (value, [low, high], from, to) => from + ((value - low) / (high - low || 1)) * (to - from);
  const yValue = (value) => (log ? Math.log10(Math.max(value, 1e-12)) : value);
  const ySpan = log ? [Math.floor(yValue(y.span[0])), Math.ceil(yValue(y.span[1]))] : y.span;
  const px = (value) => place(value, x.span, LEFT, WIDE - RIGHT), py = (value) => place(yValue(value), ySpan, HIGH - BOTTOM, TOP);
  const svg = make("svg", { class: "chart", viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": label });
  const marks = log ? ticks(ySpan[0], ySpan[1], 4).filter(Number.isInteger).map((k) => 10 ** k) : ticks(...ySpan);
  for (const value of marks) {
    svg.append(make("line", { class: "axis", x1: LEFT, x2: WIDE - RIGHT, y1: py(value), y2: py(value) }));
    svg.append(make("text", { x: LEFT - 6, y: py(value) + 4, "text-anchor": "end" }, log ? value.toExponential(0) : String(+value.toPrecision(4))));
  }
  for (const value of ticks(...x.span, 5)) {
    if (whole && !Number.isInteger(value)) continue;
    svg.append(make("text", { x: px(value), y: HIGH - BOTTOM + 16, "text-anchor": "middle" }, String(+value.toPrecision(4))));
  }
  svg.append(make("text", { x: (LEFT + WIDE - RIGHT) / 2, y: HIGH - 4, "text-anchor": "middle" }, x.title));
  return { svg, px, py };
}

function histogram(values, quantity) {
  const { name, unit, factor = 1 } = QUANTITIES[quantity];
  const [low, high] = rangeOf(quantity).map((value) => value * factor), bins = 24;
  const counts = new Array(bins).fill(0);
  for (const value of values) counts[Math.min(bins - 1, Math.max(0, Math.floor(((value * factor - low) / (high - low)) * bins)))]++;
  const title = unit ? `${name} in ${unit}; last bar: all above` : name;
  const { svg, px, py } = axes(`Histogram of the ${name}`, { span: [low, high], title }, { span: [0, Math.max(...counts, 1) * 1.05] });
  counts.forEach((count, k) => {
    if (!count) return;
    const from = px(low + ((high - low) * k) / bins), to = px(low + ((high - low) * (k + 1)) / bins);
    const share = (k + 0.5) / bins;
    svg.append(make("rect", { x: from + 0.5, width: to - from - 1, y: py(count), height: py(0) - py(count), fill: css(ramp(QUANTITIES[quantity].good ? 1 - share : share)) }));
  });
  return svg;
}

/** Lines over whole numbers; each {values, colour, name}. */
function lines(label, xTitle, series, { log = false, current = null, from = 0 } = {}) {
  const all = series.flatMap((one) => one.values).filter((value) => Number.isFinite(value) && (!log || value > 0));
  if (!all.length) return null;
  const longest = Math.max(...series.map((one) => one.values.length));
  const ySpan = log ? [Math.min(...all), Math.max(...all)] : [0, roundUp(Math.max(...all))];
  const { svg, px, py } = axes(label, { span: [from, Math.max(from + longest - 1, from + 1)], title: xTitle }, { span: ySpan }, { log, whole: true });
  for (const one of series) {
    let path = "", down = false;
    one.values.forEach((value, k) => {
      if (!Number.isFinite(value) || (log && value <= 0)) { down = false; return; }
      path += `${down ? "L" : "M"}${px(k + from).toFixed(1)} ${py(value).toFixed(1)}`;
      down = true;
      if (longest < 60) svg.append(make("circle", { cx: px(k + from), cy: py(value), r: 2.4, fill: one.colour }));
    });
    svg.append(make("path", { d: path, fill: "none", stroke: one.colour, "stroke-width": 1.8 }));
  }
  if (current !== null) svg.append(make("line", { x1: px(current), x2: px(current), y1: TOP, y2: HIGH - BOTTOM, stroke: "var(--accent)", "stroke-dasharray": "4 3" }));
  return svg;
}

function chartCard(title, svg, keys = []) {
  const card = make("section", { class: "card" }, make("h2", {}, title), svg);
  if (keys.length) card.append(make("div", { class: "legend" }, ...keys.map((key) => make("span", { class: "key" }, make("i", { style: `background:${key.colour}` }), key.name))));
  return card;
}
