/* The page: what is shown of which scene, and what happens at a click. */
let current = DATA.scenes.length - 1, quantity = "displacement", chosenStrut = null, model = null;
if (DATA.kind === "dataset") current = 0;
const scene = () => DATA.scenes[current];
const WORDS = { good: "✓ good", doubtful: "! doubtful", wrong: "✕ wrong" };

function header() {
  $("title").textContent = DATA.title;
  for (const [name, value] of Object.entries(DATA.facts)) if (value !== null) $("facts").append(make("div", {}, make("dt", {}, name), make("dd", {}, String(value))));
  const about = { run: "run", job: "print job", dataset: "dataset" }[DATA.kind];
  const licence = make("details", {}, make("summary", {}, "Drawn in 3D by three.js, MIT licence"), make("pre", {}, $("licence").textContent));
  $("footer").append(`Report of a ${about}, FrameTwin ${DATA.version}. Lengths are in mm. `, licence);
}

function verdict() {
  const { verdict: given, note, errors, seconds } = scene();
  $("verdict").hidden = !given;
  if (given) { $("verdict").className = `verdict ${given.status}`; $("verdict").textContent = `Verdict: ${WORDS[given.status]}`; }
  const items = [...(given ? given.reasons : []), ...(note ? [note] : [])];
  if (errors) items.push(`Against the truth: curves ${figure(errors.curves.mean)} mm mean, ${figure(errors.curves.max)} mm at most; joints ${figure(errors.joints.mean)} and ${figure(errors.joints.max)} mm.`);
  if (seconds) items.push(`The twin took ${figure(seconds)} s.`);
  $("reasons").hidden = !items.length;
  $("reasons").replaceChildren(make("ul", {}, ...items.map((text) => make("li", {}, text))));
}

function moments() {
  if (DATA.scenes.length < 2) return;
  $("moments").hidden = false;
  const slider = make("input", { type: "range", min: 0, max: DATA.scenes.length - 1, value: current, "aria-label": DATA.kind === "job" ? "Batch" : "Sample", oninput: () => go(+slider.value) });
  const play = make("button", { type: "button", onclick: () => {
    if (play.timer) { clearInterval(play.timer); play.timer = null; play.textContent = "▶ Play"; return; }
    if (current === DATA.scenes.length - 1) go(0);
    play.textContent = "⏸ Pause";
    play.timer = setInterval(() => { if (current < DATA.scenes.length - 1) go(current + 1); else play.click(); }, 900);
  } }, "▶ Play");
  const name = make("strong");
  if (DATA.kind === "dataset") {
    $("moments").append(make("span", {}, "Shown, the worst first"), slider, make("span", { class: "named" }, name, $("verdict")), make("output"));
    $("moments").after($("reasons"));
  } else $("moments").append(play, slider, name, make("output"));
  $("moments").told = () => {
    slider.value = current; name.textContent = scene().label;
    const batch = DATA.batches?.[current], parts = [];
    if (batch) {
      parts.push(`${batch.standing ?? "–"} struts stand, ${batch.laid ?? "–"} laid in this batch, ${batch.lost} lost`, `E_max ${figure(batch.e_max, "mm")}`);
      if (batch.collapsed) parts.push("the print has collapsed");
      if (batch.accepted.length) parts.push(`accepted: ${batch.accepted.join(", ")}`);
    }
    $("moments").querySelector("output").textContent = parts.join(" · ");
  };
}

function go(k) { current = k; chosenStrut = null; all(); }

function legend() {
  const [low, high] = rangeOf(quantity), { name, unit, factor = 1, good } = QUANTITIES[quantity];
  const stops = Array.from({ length: 13 }, (_, k) => css(ramp(good ? 1 - k / 12 : k / 12))).join(",");
  const marks = [0, 0.25, 0.5, 0.75, 1].map((share) => +((low + share * (high - low)) * factor).toPrecision(3) + (share === 1 && !good ? "+" : ""));
  const keys = [];
  const key = (colour, text) => keys.push(make("span", { class: "key" }, make("i", { style: `background:${colour}` }), text));
  const { marked, truth } = opened(scene());
  if (marked.missing?.size) key(css(MISSING), `missing (${marked.missing.size})`);
  if (marked.lost?.size) key(css(MISSING), `lost (${marked.lost.size})`);
  if (marked.torn?.size) key(css(TORN), `torn ends (${scene().torn.length})`);
  key("var(--ghost)", DATA.kind === "job" ? "design" : "plan");
  if (truth) key(OUTLINE.truth, "truth");
  $("legend").replaceChildren(make("div", { class: "scale" }, make("div", {}, `${name}${unit ? ` in ${unit}` : ""}`), make("div", { class: "strip", style: `background:linear-gradient(90deg,${stops})` }), make("div", { class: "ticks" }, ...marks.map((mark) => make("span", {}, String(mark))))), ...keys);
  $("truthbox").hidden = !truth;
}

function strutCard() {
  const own = scene(), i = opened(own).place.get(chosenStrut), box = $("strut");
  if (i === undefined) { box.replaceChildren(make("h2", {}, "Strut"), make("p", { class: "faint" }, "Click a strut, in 3D or in a list, for its numbers.")); return; }
  const { plan, curves, marked } = opened(own), o = sizeOf(curves) * i, ends = [0, 3 * curves.degree].map((k) => [...curves.slice(o + k, o + k + 3)].map((value) => value.toFixed(2)).join(", "));
  const rows = Object.entries(QUANTITIES).filter(([name]) => own.quantities[name]).map(([name, { name: words }]) => [words, told(name, own.quantities[name][i])]);
  rows.push(["radius of the plan", figure(plan.radius[chosenStrut], "mm")], ["joints", `${plan.edges[2 * chosenStrut]} and ${plan.edges[2 * chosenStrut + 1]}`], ["starts at", ends[0]], ["ends at", ends[1]]);
  for (const [strut, side, gap] of own.torn || []) if (strut === chosenStrut) rows.push([`${END_NAMES[side]} torn off its joint by`, figure(gap, "mm")]);
  const says = Object.keys(marked).filter((name) => marked[name].has(chosenStrut));
  box.replaceChildren(make("h2", {}, `Strut ${chosenStrut} `, make("small", {}, says.join(", "))), make("table", {}, make("tbody", {}, ...rows.map(([name, value]) => make("tr", {}, make("td", {}, name), make("td", {}, value))))));
}

function histogramCard() {
  const values = (scene().quantities[quantity] || []).filter((value) => value !== null).sort((a, b) => a - b);
  const { name } = QUANTITIES[quantity];
  if (!values.length) { $("histogram").replaceChildren(make("h2", {}, "Histogram"), make("p", { class: "faint" }, "Nothing is printed.")); return; }
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const text = `mean ${told(quantity, mean)}, median ${told(quantity, values[values.length >> 1])}, largest ${told(quantity, values[values.length - 1])}`;
  $("histogram").replaceChildren(make("h2", {}, "Struts by ", name), histogram(values, quantity), make("p", { class: "hint" }, text));
}

function charts() {
  const cards = [], batches = DATA.batches || [];
  const add = (title, svg, keys) => svg && cards.push(chartCard(title, svg, keys));
  if (batches.length) {
    const by = (name) => batches.map((batch) => batch[name] ?? NaN);
    const off = [{ name: "E_max, the largest", values: by("e_max"), colour: "var(--second)" }, { name: "mean over the struts", values: by("deviation"), colour: "var(--bar)" }];
    add("Distance from the design by batch, mm", lines("Distance from the design by batch", "batch", off, { current }), off);
    const time = [{ name: "twin and plan", values: by("twin_seconds"), colour: "var(--second)" }, { name: "printing", values: by("printing_seconds"), colour: "var(--bar)" }].filter((one) => one.values.some(Number.isFinite));
    if (time.length) add("Time by batch, s", lines("Time by batch", "batch", time, { current, log: time.length > 1 }), time);
  }
  if (scene().loss?.length > 1) add("Convergence: image loss by step", lines("Image loss by step", "step", [{ name: "loss", values: scene().loss, colour: "var(--bar)" }], { log: true, from: 1 }));
  $("charts").replaceChildren(...cards);
}

const strutButton = (strut) => make("button", { type: "button", onclick: () => choose(strut, true) }, `strut ${strut}`);
function worst() {
  const own = scene(), { place } = opened(own);
  $("worst").hidden = !own.worst.length;
  if (!own.worst.length) return;
  const names = Object.keys(QUANTITIES).filter((name) => own.quantities[name]);
  const head = make("tr", {}, make("th", {}, ""), ...names.map((name) => make("th", {}, QUANTITIES[name].name)));
  const rows = own.worst.map((strut) => make("tr", { "data-strut": strut }, make("td", {}, strutButton(strut)), ...names.map((name) => make("td", {}, told(name, own.quantities[name][place.get(strut)])))));
  const by = own.quantities.error ? "by error" : DATA.kind === "job" ? "by distance from the design" : "by displacement";
  const parts = [make("h2", {}, "Worst struts ", make("small", {}, by)), make("div", { class: "wide" }, make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows)))];
  if (own.crops) {
    const blocks = Object.entries(own.crops).filter(([, crops]) => crops.length).sort((a, b) => own.worst.indexOf(+a[0]) - own.worst.indexOf(+b[0]));
    parts.push(make("div", { class: "crops" }, ...blocks.map(([strut, crops]) => make("div", { class: "crop" }, make("h3", {}, strutButton(+strut)), make("div", {}, ...crops.map((crop) => make("figure", {}, shot(crop, own, { only: +strut, label: `Strut ${strut} in ${own.views[crop.view].name}`, onclick: () => choose(+strut, true) }), make("figcaption", {}, own.views[crop.view].name))))))));
  }
  $("worst").replaceChildren(...parts);
}

const END_NAMES = ["start", "end"];
function torn() {
  const own = scene(), { plan } = opened(own), ends = own.torn || [];
  $("torn").hidden = !ends.length;
  const rows = ends.map(([strut, side, gap]) => make("tr", { "data-strut": strut }, make("td", {}, strutButton(strut)), make("td", {}, END_NAMES[side]), make("td", {}, String(plan.edges[2 * strut + side])), make("td", {}, figure(gap, "mm"))));
  const head = make("tr", {}, ...["", "which end", "joint", "gap"].map((text) => make("th", {}, text)));
  $("torn").replaceChildren(make("h2", {}, "Ends that are off their joints"), make("div", { class: "wide" }, make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows))));
}

function photographs() {
  const own = scene(), pictured = (own.views || []).filter((view) => view.picture);
  $("photographs").hidden = !(own.views || []).length;
  if (!(own.views || []).length) return;
  const share = (value) => (typeof value === "number" ? `${(100 * value).toFixed(1)} %` : "–");
  const caption = (view) => make("figcaption", {}, make("b", {}, view.name), " ", view.used === false ? make("span", { class: "wrong" }, "left out") : "", view.unexplained === undefined ? "" : ` ${share(view.unexplained)} of the print unexplained, ${share(view.unseen)} of the twin unseen`);
  if (!pictured.length) {
    const rows = own.views.map((view) => make("tr", {}, make("td", {}, view.name), make("td", {}, view.used === false ? "left out" : "used"), make("td", {}, share(view.unexplained)), make("td", {}, share(view.unseen))));
    const hint = DATA.kind === "run" ? make("p", { class: "hint" }, "Give the report the capture of the run (--capture) to see its pictures.") : "";
    $("photographs").replaceChildren(make("h2", {}, "Views"), make("table", {}, make("thead", {}, make("tr", {}, ...["view", "", "print unexplained", "twin unseen"].map((text) => make("th", {}, text)))), make("tbody", {}, ...rows)), hint);
    return;
  }
  const names = ["twin", "plan", ...(opened(own).truth ? ["truth"] : [])];
  const boxes = names.map((name) => { const box = make("input", { type: "checkbox", onchange: () => { LAYERS[name] = box.checked; redrawShots(); } }); box.checked = LAYERS[name]; return make("label", {}, box, make("span", { class: "key" }, make("i", { style: `background:${OUTLINE[name]}` }), `outline of the ${name}`)); });
  $("photographs").replaceChildren(make("h2", {}, "Views ", make("small", {}, "without lens distortion; a click enlarges")), make("div", { class: "tools" }, ...boxes), make("div", { class: "shots" }, ...pictured.map((view) => make("figure", {}, shot(view, own, { label: `${view.name}; enlarge or reduce` }), caption(view)))));
}

function cameras() {
  const given = (scene().cameras || []).filter((camera) => typeof camera.sigmas === "number");
  $("cameras").hidden = !given.length;
  if (!given.length) return;
  const size = (values) => (Array.isArray(values) ? Math.hypot(...values) : NaN);
  const rows = given.map((camera) => make("tr", {}, make("td", {}, String(camera.name)), make("td", {}, figure(size(camera.shift_mm), "mm")), make("td", {}, `${size(camera.turn_deg).toFixed(3)}°`), make("td", {}, `${(100 * (camera.focal_share || 0)).toFixed(2)} %`), make("td", {}, camera.sigmas.toFixed(1))));
  $("cameras").replaceChildren(make("h2", {}, "Corrections of the cameras"), make("div", { class: "wide" }, make("table", {}, make("thead", {}, make("tr", {}, ...["camera", "moved", "turned", "focal length", "standard deviations"].map((text) => make("th", {}, text)))), make("tbody", {}, ...rows))));
}

/* All samples, the worst first, above what is shown of one. */
function samples() {
  if (!DATA.samples) return;
  const known = DATA.samples.filter((row) => row.curves_max !== null).sort((a, b) => b.curves_max - a.curves_max);
  const listed = [...known, ...DATA.samples.filter((row) => row.curves_max === null)];
  const mean = known.reduce((sum, row) => sum + row.curves_mean, 0) / known.length;
  const counts = Object.keys(WORDS).map((word) => [known.filter((row) => row.verdict === word).length, word]).filter(([count]) => count).map(([count, word]) => `${count} ${word}`);
  const name = (row) => (row.scene === null ? `sample ${row.index}` : make("button", { type: "button", onclick: () => { go(row.scene); $("moments").scrollIntoView({ behavior: "smooth" }); } }, `sample ${row.index}`));
  const verdictOf = (row) => make("span", { class: row.verdict }, row.verdict);
  const cells = (row) => [row.frame, verdictOf(row), figure(row.curves_mean), figure(row.curves_max), String(row.overlooked), String(row.false)].map((cell) => make("td", {}, cell));
  const facts = (row) => (row.problem === null ? cells(row) : [make("td", { class: "problem", colspan: 6 }, row.problem)]);
  const rows = listed.map((row) => make("tr", { "data-scene": row.scene ?? "" }, make("td", {}, name(row)), ...facts(row)));
  const head = make("tr", {}, ...["", "frame", "verdict", "mean", "largest", "missing overlooked", "missing in error"].map((text) => make("th", {}, text)));
  const rest = listed.length - known.length;
  $("samples").hidden = false;
  $("samples").replaceChildren(
    make("h2", {}, "Samples ", make("small", {}, `errors between the curves in mm${known.length > DATA.scenes.length ? `; the ${DATA.scenes.length} with the largest can be opened` : ""}`)),
    make("p", {}, `All fitted samples: ${figure(mean)} mm mean, ${figure(known[0].curves_max)} mm at most; verdicts: ${counts.join(", ")}${rest ? `; ${rest} not fitted or damaged` : ""}.`),
    make("div", { class: "wide tall" }, make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows))));
}

function markSample() {
  for (const row of $("samples").querySelectorAll("tr[data-scene]")) row.classList.toggle("current", row.dataset.scene === String(current));
}

function choose(strut, scroll) {
  chosenStrut = strut;
  strutCard(); redrawShots(); model?.choose(strut);
  for (const row of document.querySelectorAll("tr[data-strut]")) row.classList.toggle("current", +row.dataset.strut === strut);
  if (scroll) $("stage").scrollIntoView({ block: "nearest", behavior: "smooth" });
}

function options() {
  const there = COLOURED.filter((name) => DATA.scenes.some((one) => (one.quantities[name] || []).some((value) => value !== null)));
  const list = there.length ? there : ["displacement"];
  if (list.includes("error") && DATA.kind !== "job") quantity = "error";
  $("quantity").append(...list.map((name) => make("option", { value: name, selected: name === quantity }, QUANTITIES[name].name)));
  $("quantity").addEventListener("change", () => { quantity = $("quantity").value; model?.recolour(quantity); legend(); histogramCard(); });
  $("ghost").addEventListener("change", () => { if (model) { model.ghost.visible = $("ghost").checked; model.draw(); } });
  $("truth").addEventListener("change", () => { if (model?.truth) { model.truth.visible = $("truth").checked; model.draw(); } });
  $("enlarge").addEventListener("change", () => { if (model) { model.enlarge = +$("enlarge").value; model.show(scene(), quantity, chosenStrut); } });
  $("home").addEventListener("click", () => model?.home());
  DARK.addEventListener("change", () => model?.show(scene(), quantity, chosenStrut));
}

function all() {
  SHOTS.length = 0;
  verdict(); $("moments").told?.(); legend(); strutCard(); histogramCard(); charts(); torn(); worst(); photographs(); cameras(); markSample();
  model?.show(scene(), quantity, chosenStrut);
}

if (DATA.kind !== "job") document.querySelector("aside").append($("charts")); // one chart: beside the model
header(); options(); moments();
try { model = new Model($("stage"), (strut) => choose(strut, false)); } catch (error) { $("nogl").hidden = false; }
samples(); all();
