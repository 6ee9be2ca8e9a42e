// Second part of the viewer: programs of the graphics card, the camera, what is drawn and what is picked.

// ---- WebGL

const canvas = byId("canvas");
const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, premultipliedAlpha: false, preserveDrawingBuffer: true });
fillPanel();
if (!gl) {
  for (const name of ["show", "colour", "opening", "view"]) byId(name).hidden = true;
  byId("panel").querySelectorAll("ul").forEach(ul => { ul.inert = true; });
  return fail("This browser has no WebGL 2, which the drawing needs. It may be switched off; the panel still says what is in the mesh.");
}
canvas.addEventListener("webglcontextlost", event => { event.preventDefault(); fail("The graphics card was lost; load the page again."); });

const COMMON = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
uniform mat3 uAxes; uniform vec3 uFocus; uniform vec2 uScale; uniform float uDepth, uPixel; uniform mat4 uMove;
uniform sampler2D uBodies, uFaces; uniform int uPass;
vec3 placed(vec3 p, uint body) {
  vec4 b = texelFetch(uBodies, ivec2(body % 1024u, body / 1024u), 0);
  return (b.w > 0.5 ? (uMove * vec4(p, 1.0)).xyz : p) + b.xyz;
}
vec4 clip(vec3 p) { vec3 c = uAxes * (p - uFocus); return vec4(c.xy * uScale, -c.z * uDepth, 1.0); }
vec4 faceColour(uint f) { return texelFetch(uFaces, ivec2(f % 2048u, f / 2048u), 0); }
bool drawn(float alpha) { // passes: 0 solid, 1 see-through, 2 findings behind other things
  int byte = int(alpha * 255.0 + 0.5);
  return uPass == 0 ? byte >= 254 : uPass == 1 ? byte > 0 && byte < 254 : byte == 254;
}
`;
const FRAGMENT = `#version 300 es
precision highp float; precision highp int;
flat in vec4 vColour; flat in uint vId; in vec3 vNormal; uniform int uPass, uPick; out vec4 colour;
void main() {
  if (uPick == 1) { uint i = vId; colour = vec4(float(i & 255u), float((i >> 8) & 255u), float((i >> 16) & 255u), float(i >> 24)) / 255.0; return; }
  float light = 1.0;
  if (dot(vNormal, vNormal) > 0.0) {
    vec3 n = normalize(vNormal); if (n.z < 0.0) n = -n;
    light = 0.62 + 0.45 * (0.55 * max(dot(n, normalize(vec3(-0.5, 0.9, 1.0))), 0.0)
      + 0.22 * max(dot(n, normalize(vec3(0.9, 0.0, 0.6))), 0.0) + 0.33 * max(dot(n, normalize(vec3(0.0, -0.2, 1.0))), 0.0));
  }
  colour = vec4(min(vColour.rgb * light, 1.0), uPass == 2 ? 0.3 : vColour.a > 0.99 ? 1.0 : vColour.a);
}`;
const FACES = COMMON + `
in vec3 aPosition; in vec4 aNormal; in uint aFace, aBody;
flat out vec4 vColour; flat out uint vId; out vec3 vNormal;
void main() {
  vColour = faceColour(aFace); vId = aFace + 1u;
  vec3 n = aNormal.xyz;
  if (texelFetch(uBodies, ivec2(aBody % 1024u, aBody / 1024u), 0).w > 0.5) n = mat3(uMove) * n;
  vNormal = uAxes * n;
  gl_Position = clip(placed(aPosition, aBody));
  if (int(vColour.a * 255.0 + 0.5) == 254) gl_Position.z -= 3.0 * uPixel * uDepth; // lies on faces of the mesh
  if (!drawn(vColour.a)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;
const LINES = COMMON + `
in vec3 aStart, aEnd; in uint aKind, aFace, aBody; uniform vec4 uLine[9]; uniform float uWidth[9]; uniform vec2 uSize;
flat out vec4 vColour; flat out uint vId; out vec3 vNormal;
void main() {
  vColour = aFace > 0u ? faceColour(aFace - 1u) : uLine[aKind]; vId = aFace; vNormal = vec3(0.0);
  vec4 a = clip(placed(aStart, aBody)), b = clip(placed(aEnd, aBody));
  vec2 along = (b.xy - a.xy) * uSize; float length_ = length(along);
  along = length_ > 1e-6 ? along / length_ : vec2(1.0, 0.0);
  float width = uWidth[aKind], side = float(gl_VertexID & 1) * 2.0 - 1.0; bool end = gl_VertexID > 1;
  vec2 shift = (vec2(-along.y, along.x) * side + along * (end ? 1.0 : -1.0) * (width > 2.5 ? 0.9 : 0.3)) * width;
  gl_Position = end ? b : a;
  gl_Position.xy += shift / uSize;
  gl_Position.z -= (1.6 * width + (aFace > 0u ? 4.0 : 0.6)) * uPixel * uDepth;
  if (width <= 0.0 || !drawn(vColour.a)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;
const DOTS = COMMON + `
in vec3 aPosition; in uint aBody; in vec4 aColour; uniform float uRadius, uAbove; flat out vec4 vColour;
void main() {
  gl_Position = clip(placed(aPosition, aBody));
  gl_Position.z -= (2.0 * uRadius + uAbove) * uPixel * uDepth;
  gl_PointSize = 2.0 * uRadius + 1.0; vColour = aColour;
  if (aColour.a == 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;
const BALL = `#version 300 es
precision highp float; flat in vec4 vColour; uniform float uRadius; out vec4 colour;
void main() {
  vec2 p = (gl_PointCoord * 2.0 - 1.0) * vec2(1.0, -1.0); float r = length(p);
  float edge = clamp((1.0 - r) * uRadius + 0.5, 0.0, 1.0); if (edge <= 0.0) discard;
  float light = 0.72 + 0.38 * max(dot(vec3(p, sqrt(max(0.0, 1.0 - r * r))), normalize(vec3(-0.4, 0.6, 0.8))), 0.0);
  colour = vec4(vColour.rgb * light, edge);
}`;

function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
  const uniform = {};
  for (let k = 0; k < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); k++) {
    const name = gl.getActiveUniform(made, k).name.replace("[0]", "");
    uniform[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniform };
}
function attributes(shader, list) {
  const array = gl.createVertexArray();
  array.buffers = [];
  gl.bindVertexArray(array);
  for (const [names, data, size, options = {}] of list) {
    const buffer = gl.createBuffer();
    array.buffers.push(buffer);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, options.dynamic ? gl.DYNAMIC_DRAW : gl.STATIC_DRAW);
    const stride = size * names.length * data.BYTES_PER_ELEMENT;
    names.forEach((name, k) => {
      const place = gl.getAttribLocation(shader.made, name);
      if (place < 0) return;
      gl.enableVertexAttribArray(place);
      if (data instanceof Uint32Array) gl.vertexAttribIPointer(place, size, gl.UNSIGNED_INT, stride, 0);
      else gl.vertexAttribPointer(place, size, { Float32Array: gl.FLOAT, Int8Array: gl.BYTE, Uint8Array: gl.UNSIGNED_BYTE }[data.constructor.name], !(data instanceof Float32Array), stride, k * size * data.BYTES_PER_ELEMENT);
      if (options.instanced) gl.vertexAttribDivisor(place, 1);
    });
  }
  return array;
}
function texture(width, height, inner, format, type, data) {
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, format, type, data);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  return made;
}

const faceShader = program(FACES, FRAGMENT), lineShader = program(LINES, FRAGMENT), dotShader = program(DOTS, BALL);
const dotNodes = [...a.ends, ...a.internal, ...a.markNodes];
const dotColours = new Uint8Array(4 * dotNodes.length);
const dots = { buffer: null, count: dotNodes.length };
let triangles, lines, faceArray, lineArray, dotArray;
// The points of the mesh, or of another moment, to the graphics card.
function place() {
  for (const array of [faceArray, lineArray, dotArray].filter(Boolean)) {
    array.buffers.forEach(buffer => gl.deleteBuffer(buffer));
    gl.deleteVertexArray(array);
  }
  triangles = triangulate(); lines = segment();
  faceArray = attributes(faceShader, [[["aPosition"], triangles.position, 3], [["aNormal"], triangles.normal, 4], [["aFace"], triangles.face, 1], [["aBody"], triangles.body, 1]]);
  lineArray = attributes(lineShader, [[["aStart", "aEnd"], lines.ends, 3, { instanced: true }], [["aKind"], lines.kind, 1, { instanced: true }], [["aFace"], lines.face, 1, { instanced: true }], [["aBody"], lines.body, 1, { instanced: true }]]);
  triangles.position = triangles.normal = lines.ends = null; // the graphics card has them
  dotArray = attributes(dotShader, [
    [["aPosition"], Float32Array.from(dotNodes.flatMap(n => [a.points[3 * n], a.points[3 * n + 1], a.points[3 * n + 2]])), 3],
    [["aBody"], Uint32Array.from(dotNodes, n => a.nodeBody[n]), 1],
    [["aColour"], dotColours, 4, { dynamic: true }],
  ]);
  dots.buffer = dotArray.buffers[2];
  gl.bindVertexArray(null);
}
function showMoment(k) {
  a.points = a.momentPoints.subarray(3 * nNodes * k, 3 * nNodes * (k + 1));
  if (head.values) a.value = a.momentValues.subarray(nFaces * k, nFaces * (k + 1));
  byId("now").textContent = head.moments[k];
  byId("moment").value = k;
  root.dataset.moment = k;
  place();
  recolour();
}
place();
const faceRows = Math.max(1, Math.ceil(nFaces / 2048)), faceBytes = new Uint8Array(4 * 2048 * faceRows);
const faceTexture = texture(2048, faceRows, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, faceBytes);
const bodyRows = Math.max(1, Math.ceil(head.nBodies / 1024)), bodyFloats = new Float32Array(4 * 1024 * bodyRows);
const bodyTexture = texture(1024, bodyRows, gl.RGBA32F, gl.RGBA, gl.FLOAT, bodyFloats);

function recolour() {
  let shown = 0;
  for (let f = 0; f < nFaces; f++) {
    const colour = faceColour(f);
    faceBytes.set(colour, 4 * f);
    shown += colour[3] > 0;
  }
  gl.bindTexture(gl.TEXTURE_2D, faceTexture);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 2048, faceRows, gl.RGBA, gl.UNSIGNED_BYTE, faceBytes);
  const plain = a.ends.length, last = plain + a.internal.length;
  for (let k = 0; k < dots.count; k++) {
    const of = k < last ? -1 : a.markOf[k - last];
    const visible = k < plain ? state.slave : k < last ? state.internal : marksShown(of);
    const colour = k < plain || (k < last && wrong && state.findings) ? INK : k < last ? hex(colours.dot) : hex(colours[severity[of]]);
    dotColours.set([...colour, visible ? 255 : 0], 4 * k);
  }
  gl.bindBuffer(gl.ARRAY_BUFFER, dots.buffer);
  gl.bufferSubData(gl.ARRAY_BUFFER, 0, dotColours);
  root.dataset.faces = shown;
  redraw();
}

// ---- bodies apart

const centres = new Float64Array(4 * head.nBodies);
for (let n = 0; n < nNodes; n++) {
  const b = 4 * a.nodeBody[n];
  for (let c = 0; c < 3; c++) centres[b + c] += a.points[3 * n + c];
  centres[b + 3]++;
}
const opening = head.opening;
let move = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
function spread() {
  const t = state.open;
  bodyFloats.fill(0);
  if (opening) {
    const { axis: [x, y, z], centre, shift, angle } = opening, c = Math.cos(t * angle), s = Math.sin(t * angle), k = 1 - c;
    const R = [c + x * x * k, y * x * k + z * s, z * x * k - y * s, x * y * k - z * s, c + y * y * k, z * y * k + x * s, x * z * k + y * s, y * z * k - x * s, c + z * z * k];
    const turned = [0, 1, 2].map(i => R[i] * centre[0] + R[3 + i] * centre[1] + R[6 + i] * centre[2]);
    move = [...R.slice(0, 3), 0, ...R.slice(3, 6), 0, ...R.slice(6), 0, ...[0, 1, 2].map(i => centre[i] - turned[i] + t * shift[i]), 1];
    for (const b of opening.bodies) bodyFloats[4 * b + 3] = 1;
  } else for (let b = 0; b < head.nBodies; b++) for (let i = 0; i < 3; i++) bodyFloats[4 * b + i] = 1.2 * t * centres[4 * b + i] / (centres[4 * b + 3] || 1);
  gl.bindTexture(gl.TEXTURE_2D, bodyTexture);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 1024, bodyRows, gl.RGBA, gl.FLOAT, bodyFloats);
  redraw();
}
function placed(n) {
  const p = [a.points[3 * n], a.points[3 * n + 1], a.points[3 * n + 2]], b = 4 * a.nodeBody[n];
  const q = bodyFloats[b + 3] > 0.5 ? [0, 1, 2].map(i => move[i] * p[0] + move[4 + i] * p[1] + move[8 + i] * p[2] + move[12 + i]) : p;
  return q.map((x, i) => x + bodyFloats[b + i]);
}

// ---- the camera: parallel rays, z upright

const camera = { az: 0, el: 0, focus: [0, 0, 0], half: 1 };
const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
function axes(c = camera) {
  const [ca, sa, ce, se] = [Math.cos(c.az), Math.sin(c.az), Math.cos(c.el), Math.sin(c.el)];
  return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
}
function looking(eye) {
  return Math.abs(eye[2]) > 0.999 ? { az: -Math.PI / 2, el: Math.sign(eye[2]) * Math.PI / 2 } : { az: Math.atan2(eye[1], eye[0]), el: Math.asin(eye[2]) };
}
const sides = () => { const w = Math.max(1, canvas.clientWidth), h = Math.max(1, canvas.clientHeight); return [w, h]; };
function framed(nodes, direction, least = 0) {
  const [right, up] = axes(direction), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const basis = axes(direction);
  for (const n of nodes) {
    const p = placed(n);
    for (let k = 0; k < 3; k++) { const q = dot(basis[k], p); low[k] = Math.min(low[k], q); high[k] = Math.max(high[k], q); }
  }
  if (low[0] > high[0]) return null;
  const [w, h] = sides(), middle = [0, 1, 2].map(k => (low[k] + high[k]) / 2);
  const half = Math.max(least, (high[1] - low[1]) / 2, (high[0] - low[0]) / 2 * h / w) * 1.1 || 1;
  return { ...direction, half, focus: [0, 1, 2].map(i => basis[0][i] * middle[0] + basis[1][i] * middle[1] + basis[2][i] * middle[2]) };
}
function* everyNode() { for (let n = 0; n < nNodes; n++) yield n; }
const fitted = (direction = { az: camera.az, el: camera.el }) => framed(everyNode(), direction);
let flight = 0;
function fly(target, at_once = false) {
  if (!target) return;
  const start = { ...camera }, from = performance.now(), mine = ++flight;
  const turn = Math.atan2(Math.sin(target.az - start.az), Math.cos(target.az - start.az));
  const still = at_once || matchMedia("(prefers-reduced-motion: reduce)").matches;
  const step = now => {
    if (mine !== flight) return;
    const u = still ? 1 : Math.min(1, Math.max(0, (now - from) / 350)), t = u * u * (3 - 2 * u);
    Object.assign(camera, { az: start.az + t * turn, el: start.el + t * (target.el - start.el), half: start.half * (target.half / start.half) ** t, focus: start.focus.map((x, i) => x + t * (target.focus[i] - x)) });
    redraw();
    if (u < 1) requestAnimationFrame(step);
  };
  step(from);
}

// ---- drawing

let waiting = false;
function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => { waiting = false; draw(); });
}
const ratio = () => Math.min(2, window.devicePixelRatio || 1);
function common(shader, pass, pick) {
  const [w, h] = sides(), u = shader.uniform;
  gl.useProgram(shader.made);
  const [r, p, e] = axes();
  gl.uniformMatrix3fv(u.uAxes, false, [r[0], p[0], e[0], r[1], p[1], e[1], r[2], p[2], e[2]]);
  gl.uniform3fv(u.uFocus, camera.focus);
  gl.uniform2f(u.uScale, h / w / camera.half, 1 / camera.half);
  gl.uniform1f(u.uDepth, 1 / 8);
  gl.uniform1f(u.uPixel, 2 * camera.half / (h * ratio()));
  gl.uniformMatrix4fv(u.uMove, false, move);
  gl.uniform1i(u.uBodies, 0); gl.uniform1i(u.uFaces, 1);
  gl.uniform1i(u.uPass, pass);
  if (u.uPick) gl.uniform1i(u.uPick, pick ? 1 : 0);
  gl.activeTexture(gl.TEXTURE0); gl.bindTexture(gl.TEXTURE_2D, bodyTexture);
  gl.activeTexture(gl.TEXTURE1); gl.bindTexture(gl.TEXTURE_2D, faceTexture);
  gl.activeTexture(gl.TEXTURE2);
}
function drawFaces(pass, pick = false) {
  common(faceShader, pass, pick);
  gl.bindVertexArray(faceArray);
  gl.drawArrays(gl.TRIANGLES, 0, triangles.count);
}
function drawLines(pass) {
  common(lineShader, pass);
  const [w, h] = sides(), k = ratio();
  // lines thin out, and are gone, where cells are so small that lines would hide them
  const pixels = kind => lines.length[kind] / (2 * camera.half / h), clear = (kind, least, most) => Math.min(1, Math.max(0, (pixels(kind) - least) / (most - least)));
  const fade = clear(0, 3, 12), inner = clear(2, 4, 14), skin = clear(OUTLINE, 5, 30), named = state.slave || state.master;
  const solid = state.bodies === "hidden" ? 0 : state.bodies === "ghost" ? 0.25 : 1, marks = state.finding >= 0 || state.findings;
  const widths = [state.edges * fade * 0.9, solid || state.edges ? 1.3 : 0, state.edges * named * inner * 0.9, named && skin ? 0.4 + 2 * skin : 0, named ? 1.6 + skin : 0, 1.6, state.slave ? 7 : 1.6, state.master ? 4.5 : 1.6, marks ? 9 : 0];
  const dim = state.group >= 0 ? 0.45 : 1, dark = state.theme === "dark" && state.bodies !== "solid";
  const line = (rgb, alpha) => [...rgb.map(c => c / 255), alpha * dim];
  const tones = [line(dark ? [150, 158, 166] : [138, 146, 154], solid * (0.35 + 0.65 * fade)), line(dark ? [190, 196, 202] : [92, 100, 108], Math.max(solid, 0.35)), line([74, 82, 90], 0.9), line(INK, 1), line(INK, 1)];
  gl.uniform4fv(lineShader.uniform.uLine, [...tones.flat(), ...Array(16).fill(1)]);
  gl.uniform1fv(lineShader.uniform.uWidth, widths.map(x => x * k));
  gl.uniform2f(lineShader.uniform.uSize, w * k, h * k);
  gl.bindVertexArray(lineArray);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, lines.count);
}
function drawDots(first, count, radius) {
  if (!count) return;
  common(dotShader, 0);
  gl.uniform1f(dotShader.uniform.uRadius, radius * ratio());
  gl.uniform1f(dotShader.uniform.uAbove, (a.ends.length ? 20 : 0) * ratio()); // above the segments
  gl.bindVertexArray(dotArray);
  gl.drawArrays(gl.POINTS, first, count);
}
function resize() {
  const [w, h] = sides().map(x => Math.round(x * ratio()));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
}
function draw() {
  if (gl.isContextLost()) return;
  resize();
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(0, 0, 0, 0);
  gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL); gl.depthMask(true); gl.disable(gl.BLEND);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  drawFaces(0); drawLines(0);
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthMask(false);
  drawFaces(1); drawLines(1);
  if (severity.length) { gl.depthFunc(gl.GREATER); drawFaces(2); drawLines(2); gl.depthFunc(gl.LEQUAL); }
  gl.depthMask(true);
  const radius = Math.min(5.5, Math.max(1.2, 0.13 * spacing / (2 * camera.half / sides()[1])));
  drawDots(0, a.ends.length, 0.8 * radius); drawDots(a.ends.length, a.internal.length, radius);
  gl.disable(gl.DEPTH_TEST);
  drawDots(a.ends.length + a.internal.length, a.markNodes.length, Math.max(4.5, radius));
  triad();
}
// How far internal nodes stand apart, to size their dots: a macro-element has about the length of its outline.
const spacing = (() => {
  let length = 0, n = 0;
  const macros = new Set(a.macro);
  for (let e = 0; e < a.edgeKind.length; e++) if (a.edgeKind[e] === OUTLINE || a.edgeKind[e] === SEGMENT) {
    const [i, j] = [3 * a.edges[3 * e], 3 * a.edges[3 * e + 1]];
    length += Math.hypot(...[0, 1, 2].map(c => a.points[i + c] - a.points[j + c])); n++;
  }
  return n ? length / n * Math.min(1, Math.sqrt(macros.size / Math.max(1, a.internal.length)) * 1.2) : 0.05;
})();
function triad() {
  const [right, up, eye] = axes(), svg = byId("triad"), dark = state.theme === "dark";
  const arms = ["x", "y", "z"].map((name, i) => ({ name, x: 32 * right[i], y: -32 * up[i], z: eye[i], tone: (dark ? ["#f08a6c", "#8fcf8f", "#83aef5"] : ["#b5402a", "#2f7d3c", "#2b5fb8"])[i] }));
  const ns = "http://www.w3.org/2000/svg";
  svg.replaceChildren(...arms.filter(p => Math.hypot(p.x, p.y) > 2).sort((p, q) => p.z - q.z).flatMap(p => {
    const line = document.createElementNS(ns, "line"), word = document.createElementNS(ns, "text");
    for (const [k, v] of Object.entries({ x2: p.x, y2: p.y, stroke: p.tone })) line.setAttribute(k, v);
    for (const [k, v] of Object.entries({ x: 1.32 * p.x, y: 1.32 * p.y + 4, fill: p.tone, "text-anchor": "middle" })) word.setAttribute(k, v);
    word.textContent = p.name;
    return [line, word];
  }));
}

// ---- picking: the face under a point of the canvas, drawn by its number

const pickable = { frame: gl.createFramebuffer(), colour: gl.createRenderbuffer(), depth: gl.createRenderbuffer(), w: 0, h: 0 };
async function pick(x, y, wait = false) {
  resize();
  const { width: w, height: h } = canvas, k = ratio();
  gl.bindFramebuffer(gl.FRAMEBUFFER, pickable.frame);
  if (pickable.w !== w || pickable.h !== h) {
    for (const [name, format, place] of [["colour", gl.RGBA8, gl.COLOR_ATTACHMENT0], ["depth", gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, pickable[name]);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, w, h);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, pickable[name]);
    }
    Object.assign(pickable, { w, h });
  }
  const px = Math.floor(x * k), py = h - 1 - Math.floor(y * k);
  gl.viewport(0, 0, w, h);
  gl.enable(gl.SCISSOR_TEST); gl.scissor(px, py, 1, 1);
  gl.clearColor(0, 0, 0, 0); gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL); gl.depthMask(true); gl.disable(gl.BLEND);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  drawFaces(0, true);
  pickLines();
  const bytes = await readBack(px, py, wait);
  return (bytes[0] | bytes[1] << 8 | bytes[2] << 16 | bytes[3] << 24) - 1;
}
// A pixel of what was just drawn, without making the graphics card stop for it, unless we are to wait.
async function readBack(px, py, wait) {
  const bytes = new Uint8Array(4), buffer = gl.createBuffer();
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
  gl.bufferData(gl.PIXEL_PACK_BUFFER, 4, gl.STREAM_READ);
  gl.readPixels(px, py, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, 0);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  gl.disable(gl.SCISSOR_TEST);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (wait) gl.finish(); else gl.flush();
  while (!gl.isContextLost() && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) await new Promise(done => setTimeout(done, 4));
  gl.deleteSync(fence);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
  gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, bytes);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  gl.deleteBuffer(buffer);
  return bytes;
}
function pickLines() { // only segments are faces: other lines would have no number
  if (!lines.kind.some(k => k >= SEGMENT)) return;
  common(lineShader, 0, true);
  const [w, h] = sides(), k = ratio();
  gl.uniform1fv(lineShader.uniform.uWidth, [0, 0, 0, 0, 0, 6, 9, 7, 10].map(x => x * k));
  gl.uniform2f(lineShader.uniform.uSize, w * k, h * k);
  gl.bindVertexArray(lineArray);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, lines.count);
}
function describe(f) {
  const type = head.cellTypes[a.cellType[f]], role = a.role[f], said = [];
  const groups = head.combinations[a.groups[f]].map(g => head.groups[g].name);
  if (a.skin[f] >= 0) {
    said.push(`${role === SLAVE ? "slave" : "master"} face ${a.skin[f]}, ${head.faceTypes[a.type[f]].name}`);
    if (role === SLAVE && head.cut) said.push(`macro-element ${a.macro[f]}`);
    if (a.cell[f] !== a.skin[f]) said.push(`of cell ${a.cell[f]}, ${type}`);
  } else said.push(`cell ${a.cell[f]}, ${type}`);
  if (head.nBodies > 1 && head.bodyNames[a.nodeBody[a.nodes[firstNode[f]]]]) said.push(`body ${head.bodyNames[a.nodeBody[a.nodes[firstNode[f]]]].replace(/^the body /, "")}`);
  if (groups.length) said.push(`${groups.length > 1 ? "groups" : "group"} ${groups.join(", ")}`);
  if (head.values && Number.isFinite(a.value[f])) said.push(`${head.values.what} ${a.value[f].toPrecision(4)}${a.invalid[f] ? " (invalid)" : ""}`);
  if (role === MARK) said.push(head.findings[a.of[f]].message);
  return said;
}
function showDetails(f) {
  state.picked = f;
  byId("details").hidden = f < 0;
  if (f >= 0) {
    const table = make("table"), row = (cells, tag) => { const tr = make("tr"); tr.append(...cells.map(c => make(tag, c))); return tr; };
    const digits = Math.min(20, Math.max(0, 6 - Math.floor(Math.log10(head.half)))); // what a float keeps
    table.append(row(["node", "x", "y", "z"].slice(0, dimension + 1), "th"));
    for (let k = firstNode[f]; k < firstNode[f + 1]; k++) {
      const n = a.nodes[k], x = [0, 1, 2].map(c => head.centre[c] + head.half * a.points[3 * n + c]);
      table.append(row([a.nodeNumber[n], ...x.slice(0, dimension).map(c => +c.toFixed(digits))], "td"));
    }
    byId("detail").replaceChildren(...describe(f).map((text, k) => make("div", text, { class: k ? "" : "first" })), table);
  }
  recolour();
}
