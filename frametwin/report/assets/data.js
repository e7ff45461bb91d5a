"use strict";
/* What the page holds, its numbers and words. */
const DATA = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);

/** An element with attributes and children; text is never read as HTML. */
function make(tag, attributes = {}, ...children) {
  const svg = ["svg", "path", "line", "rect", "text", "circle", "g"].includes(tag);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (char) => char.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

const QUANTITIES = {
  displacement: { name: DATA.kind === "job" ? "distance from the design" : "displacement", unit: "mm" },
  error: { name: "largest error", unit: "mm" },
  error_mean: { name: "mean error", unit: "mm" },
  sigma_across: { name: "sigma across the strut", unit: "mm" },
  sigma_along: { name: "sigma along the strut", unit: "mm" },
  completeness: { name: "completeness", unit: "%", factor: 100, good: true },
  confidence: { name: "confidence", unit: "", good: true },
  gap: { name: "gap at a torn end", unit: "mm" },
};
const COLOURED = ["displacement", "error", "sigma_across", "completeness", "gap"];
const OUTLINE = { twin: "#e8751a", plan: "#2a8fd6", truth: "#2fb58b" };
const DARK = window.matchMedia("(prefers-color-scheme: dark)");

/** A number with three digits that tell something, and its unit. */
function figure(value, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const digits = size === 0 ? 0 : size < 0.001 ? 5 : size < 1 ? 3 : size < 10 ? 2 : size < 1000 ? 1 : 0;
  return value.toFixed(digits) + (unit ? " " + unit : "");
}
function told(quantity, value) {
  if (value === null || value === undefined) return "–";
  const { unit, factor = 1 } = QUANTITIES[quantity];
  return unit === "%" ? Math.round(value * factor) + " %" : figure(value * factor, unit);
}

/** A round number at or above another. */
function roundUp(value) {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].find((step) => step * power >= value * 0.999) * power;
}

/* Viridis without its darkest end, so that struts stand out on light and dark alike. */
const RAMP = [[72, 53, 129], [49, 104, 142], [38, 145, 140], [53, 183, 121], [160, 210, 50], [245, 190, 30], [235, 95, 30]];
function ramp(share) {
  const at = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const low = Math.min(Math.floor(at), RAMP.length - 2);
  return RAMP[low].map((value, k) => value + (RAMP[low + 1][k] - value) * (at - low));
}
const css = (rgb) => `rgb(${rgb.map(Math.round).join(" ")})`;
const MISSING = [214, 39, 60], NONE = [130, 138, 150], TORN = [150, 60, 190];

/** Curves one after the other, which know their degree. */
function curvesIn(text, degree = 3) {
  return Object.assign(floats(text), { degree });
}

/** The scene, decoded once. */
function opened(scene) {
  if (scene.open) return scene.open;
  const plan = scene.plan || DATA.plan;
  plan.open = plan.open || { curves: curvesIn(plan.curves), radius: plan.radius, edges: plan.edges };
  const place = new Map(scene.struts.map((strut, i) => [strut, i]));
  const marked = {};
  for (const [name, struts] of Object.entries(scene.marks)) marked[name] = new Set(struts);
  scene.open = { plan: plan.open, curves: curvesIn(scene.curves, scene.degree), truth: scene.truth ? curvesIn(scene.truth) : null, place, marked };
  return scene.open;
}

/** How many numbers each of the curves has. */
const sizeOf = (curves) => 3 * (curves.degree + 1);

/** Bernstein polynomials. */
function bernstein(degree, u) {
  let found = [1];
  for (let n = 1; n <= degree; n++) found = Array.from({ length: n + 1 }, (_, k) => (1 - u) * (found[k] ?? 0) + u * (found[k - 1] ?? 0));
  return found;
}

/** A point of the curve number i. */
function pointOn(curves, i, u, out) {
  const shares = bernstein(curves.degree, u), o = sizeOf(curves) * i;
  out.fill(0);
  shares.forEach((share, n) => { for (let k = 0; k < 3; k++) out[k] += share * curves[o + 3 * n + k]; });
  return out;
}

/** The numbers of the curve number i, written with a higher degree. */
function elevated(curves, i, degree) {
  let points = [...curves.subarray(sizeOf(curves) * i, sizeOf(curves) * (i + 1))];
  for (let n = curves.degree + 1; n <= degree; n++) {
    const before = points;
    points = Array.from({ length: 3 * n + 3 }, (_, at) => {
      const share = Math.floor(at / 3) / n;
      return share * (before[at - 3] ?? 0) + (1 - share) * (before[at] ?? 0);
    });
  }
  return points;
}

/** Range of a quantity over all scenes, so that colours of batches can be compared. */
const RANGES = {};
function rangeOf(quantity) {
  if (quantity === "completeness") return [0, 1];
  if (!RANGES[quantity]) {
    const values = DATA.scenes.flatMap((scene) => scene.quantities[quantity] || []).filter((value) => value !== null);
    values.sort((a, b) => a - b);
    RANGES[quantity] = [0, roundUp(values.length ? values[Math.floor(0.985 * (values.length - 1))] : 1)];
  }
  return RANGES[quantity];
}
function colourOf(scene, quantity, i) {
  const { marked } = opened(scene);
  if (marked.missing?.has(scene.struts[i]) || marked.lost?.has(scene.struts[i])) return MISSING;
  const value = scene.quantities[quantity]?.[i];
  if (value === null || value === undefined) return NONE;
  const [low, high] = rangeOf(quantity);
  const share = (value - low) / (high - low);
  return ramp(QUANTITIES[quantity].good ? 1 - share : share);
}
