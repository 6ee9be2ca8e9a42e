// The viewer of a page, in three parts that make one function: here the arrays, the bent faces, their colours.
// Every word of the mesh's enters the page as text, never as markup.
"use strict";
(async () => {
const byId = id => document.getElementById(id);
const root = document.documentElement;
const fail = text => { byId("message").textContent = text; root.dataset.state = "failed"; };
window.addEventListener("error", event => fail(`This page met an error: ${event.message}`));
window.addEventListener("unhandledrejection", event => fail(`This page met an error: ${event.reason}`));
const head = JSON.parse(byId("head").textContent);
const hash = new URLSearchParams(location.hash.slice(1));
const make = (tag, text, attributes = {}) => {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
};
byId("title").textContent = head.title;
byId("counts").textContent = head.title === head.counts ? "" : head.counts;
byId("message").textContent = "unpacking the mesh";

// ---- the arrays

async function unpack() {
  const text = atob(byId("block").textContent.trim());
  const bytes = Uint8Array.from(text, c => c.charCodeAt(0));
  byId("block").textContent = "";
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const block = await new Response(stream).arrayBuffer();
  const kinds = { float32: Float32Array, float64: Float64Array, int32: Int32Array, uint8: Uint8Array };
  return Object.fromEntries(Object.entries(head.arrays).map(([name, [kind, start, length]]) =>
    [name, new kinds[kind](block, start, length)]));
}
if (typeof DecompressionStream === "undefined") return fail("This browser is too old for this page; any of 2023 or later will do.");
const a = await unpack();
const BODY = 0, SLAVE = 1, MASTER = 2, MARK = 3, OUTLINE = 3, SEGMENT = 5;
const nFaces = a.type.length, nNodes = a.points.length / 3;
const firstNode = new Int32Array(nFaces + 1);
for (let f = 0; f < nFaces; f++) firstNode[f + 1] = firstNode[f] + head.faceTypes[a.type[f]].nodes;
const bodyOf = f => a.nodeBody[a.nodes[firstNode[f]]];

// Points of a face or an edge: the weights of its nodes, as the cell's shape functions have them.
function bend(weights, nodes, start, out, at) {
  for (const row of weights) {
    let x = 0, y = 0, z = 0;
    for (let k = 0; k < row.length; k++) {
      const p = 3 * nodes[start + k];
      x += row[k] * a.points[p]; y += row[k] * a.points[p + 1]; z += row[k] * a.points[p + 2];
    }
    out[at++] = x; out[at++] = y; out[at++] = z;
  }
  return at;
}

// Triangles, three points of their own each: positions, normals, face, body.
function triangulate() {
  let n = 0;
  for (let f = 0; f < nFaces; f++) n += 3 * head.faceTypes[a.type[f]].triangles.length;
  const position = new Float32Array(3 * n), normal = new Int8Array(4 * n), face = new Uint32Array(n), body = new Uint32Array(n);
  const largest = Math.max(...Object.values(head.faceTypes).map(t => t.weights.length));
  const x = new Float32Array(3 * largest), m = new Float32Array(3 * largest);
  let v = 0;
  for (let f = 0; f < nFaces; f++) {
    const type = head.faceTypes[a.type[f]];
    if (!type.triangles.length) continue;
    bend(type.weights, a.nodes, firstNode[f], x, 0);
    m.fill(0);
    for (const [i, j, k] of type.triangles) {
      const e = [0, 1, 2].map(c => x[3 * j + c] - x[3 * i + c]), g = [0, 1, 2].map(c => x[3 * k + c] - x[3 * i + c]);
      const w = [e[1] * g[2] - e[2] * g[1], e[2] * g[0] - e[0] * g[2], e[0] * g[1] - e[1] * g[0]];
      for (const q of [i, j, k]) for (let c = 0; c < 3; c++) m[3 * q + c] += w[c];
    }
    for (const triangle of type.triangles) for (const q of triangle) {
      const length = 127 / (Math.hypot(m[3 * q], m[3 * q + 1], m[3 * q + 2]) || 1);
      for (let c = 0; c < 3; c++) { position[3 * v + c] = x[3 * q + c]; normal[4 * v + c] = length * m[3 * q + c]; }
      face[v] = f; body[v++] = bodyOf(f);
    }
  }
  return { position, normal, face, body, count: n };
}

// Lines: both ends, kind, face of a segment (its place + 1) and body of each straight piece.
function segment() {
  const curve = head.faceTypes[2].weights, straight = [[1, 0], [0, 1]], count = a.edgeKind.length;
  let n = 0;
  for (let e = 0; e < count; e++) n += a.edges[3 * e + 2] < 0 ? 1 : curve.length - 1;
  const ends = new Float32Array(6 * n), kind = new Uint32Array(n), face = new Uint32Array(n), body = new Uint32Array(n);
  const x = new Float32Array(3 * curve.length);
  const length = new Float64Array(SEGMENT + 1), times = new Float64Array(SEGMENT + 1); // of edges, by kind
  let v = 0;
  for (let e = 0; e < count; e++) {
    const weights = a.edges[3 * e + 2] < 0 ? straight : curve, f = a.edgeFace[e];
    bend(weights, a.edges, 3 * e, x, 0);
    for (let k = 0; k + 1 < weights.length; k++) {
      ends.set(x.subarray(3 * k, 3 * k + 6), 6 * v);
      kind[v] = f < 0 ? a.edgeKind[e] : SEGMENT + a.role[f];
      face[v] = f + 1;
      body[v++] = a.nodeBody[a.edges[3 * e]];
    }
    length[a.edgeKind[e]] += Math.hypot(x[0] - x[3], x[1] - x[4], x[2] - x[5]) * (weights.length - 1);
    times[a.edgeKind[e]]++;
  }
  return { ends, kind, face, body, count: n, length: length.map((l, k) => times[k] ? l / times[k] : 1) };
}

// ---- what is shown

const state = {
  bodies: hash.get("bodies") || head.bodiesAs, slave: true, master: true, internal: true, edges: true, findings: true,
  colour: hash.get("colour") || (head.values ? "value" : "role"), open: 0, finding: -1, group: -1, picked: -1,
  theme: hash.get("theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"),
};
const hex = text => [0, 2, 4].map(k => parseInt(text.slice(k, k + 2), 16));
const colours = head.colours;
const palette = colours.palette.map(hex), bodyColours = colours.bodies.map(hex), ramp = colours.ramp.map(hex);
const inside = hex(colours.inside), masterColour = hex(colours.master), invalid = hex(colours.invalid);
const ACCENT = [200, 60, 160], INK = [27, 31, 36];
const mix = (from, to, t) => from.map((c, k) => c + t * (to[k] - c));
const onRamp = value => {
  if (!Number.isFinite(value)) return bodyColours[0];
  const { bad, good } = head.values, t = (good === bad ? 1 : Math.min(1, Math.max(0, (value - bad) / (good - bad)))) * (ramp.length - 1);
  const k = Math.min(ramp.length - 2, Math.floor(t));
  return mix(ramp[k], ramp[k + 1], t - k);
};
const inGroup = head.combinations.map(set => new Set(set));
const severity = head.findings.map(f => f.severity);
const wrong = severity.some(s => s === "error" || s === "warning");
const marksShown = of => of === state.finding || (state.finding < 0 && state.findings && (severity[of] === "error" || severity[of] === "warning"));
const alphaOfBodies = () => ({ solid: 255, ghost: 40, hidden: 0 })[state.bodies] ?? 255;

// Colour and alpha of a face; 0 is not drawn, 254 is a finding (drawn through what hides it), 255 solid.
function faceColour(f) {
  const role = a.role[f], line = !head.faceTypes[a.type[f]].triangles.length;
  if (role === MARK) return marksShown(a.of[f]) ? [...hex(colours[severity[a.of[f]]]), 254] : [0, 0, 0, 0];
  const named = (role === SLAVE && state.slave) || (role === MASTER && state.master);
  let colour = a.cutOpen[f] ? inside : bodyColours[bodyOf(f) % bodyColours.length];
  if (line) colour = state.theme === "dark" ? [150, 158, 166] : [92, 100, 108];
  if (named) colour = role === SLAVE ? palette[a.paint[f]] : masterColour;
  if (state.colour === "value" && (!line || (head.values.onSkin && role === SLAVE))) colour = a.invalid[f] ? invalid : onRamp(a.value[f]);
  else if (named && wrong && state.findings) colour = mix(colour, [255, 255, 255], 0.55);
  if (state.group >= 0) colour = inGroup[a.groups[f]].has(state.group) ? ACCENT : mix(colour, [225, 227, 230], 0.75);
  if (f === state.picked) colour = mix(colour, ACCENT, 0.7);
  const lit = state.group >= 0 && inGroup[a.groups[f]].has(state.group) && !volumes[state.group];
  return [...colour, named || lit || f === state.picked ? 255 : alphaOfBodies()];
}
const dimension = head.plane ? 2 : 3;
const volumes = head.groups.map(g => g.dim === dimension);
