// Last part of the viewer: details, the panel, mouse, touch and keys, and the start.

// ---- the panel

function checkbox(name, text, shades, round = false) {
  const label = make("label", undefined, { class: "row" }), box = make("input", undefined, { type: "checkbox" });
  const swatch = make("span", undefined, { class: round ? "swatch dot" : "swatch" });
  swatch.append(...shades.map(c => { const i = make("i"); i.style.background = `#${c}`; return i; }));
  box.checked = state[name];
  box.addEventListener("change", () => { state[name] = box.checked; recolour(); });
  label.append(box, ...(shades.length ? [swatch] : []), make("span", text));
  byId("show").append(label);
}
function choice(place, options, current, chosen, pressed = true) {
  const buttons = Object.entries(options).map(([value, text]) => {
    const button = make("button", text, { type: "button" });
    button.addEventListener("click", () => { chosen(value); mark(value); });
    return [value, button];
  });
  const mark = value => pressed && buttons.forEach(([v, b]) => b.setAttribute("aria-pressed", v === value));
  mark(current);
  byId(place).append(...buttons.map(([, b]) => b));
}
function list(place, rows, name, chosen) { // rows: [index, colour or null, text, aside, disabled]
  const ul = byId(place).querySelector("ul"), MOST = 500, buttons = [];
  const mark = () => buttons.forEach(([k, b]) => b.setAttribute("aria-pressed", k === state[name]));
  ul.replaceChildren(...rows.slice(0, MOST).map(([index, colour, text, aside, disabled]) => {
    const li = make("li"), button = make("button", undefined, { type: "button" });
    if (colour) { const b = make("b", undefined, severity[index] === "error" ? { class: "square" } : {}); b.style.background = `#${colour}`; button.append(b); }
    button.append(make("span", text));
    if (aside) button.append(make("small", aside));
    button.disabled = disabled;
    button.addEventListener("click", () => { chosen(index === state[name] ? -1 : index); });
    li.append(button); buttons.push([index, button]);
    return li;
  }), ...(rows.length > MOST ? [make("li", `and ${rows.length - MOST} more`, { class: "soft" })] : []));
  byId(place).hidden = false;
  (list.marks ||= {})[place] = mark;
  mark();
}
const markLists = () => Object.values(list.marks || {}).forEach(mark => mark());
function chooseGroup(k) { state.group = k; markLists(); recolour(); }
function chooseFinding(k) {
  state.finding = k;
  markLists();
  recolour();
  if (k < 0) return;
  const nodes = [...a.markNodes].filter((_, i) => a.markOf[i] === k);
  for (let f = 0; f < nFaces; f++) if (a.role[f] === MARK && a.of[f] === k) for (let i = firstNode[f]; i < firstNode[f + 1]; i++) nodes.push(a.nodes[i]);
  const near = framed(nodes, { az: camera.az, el: camera.el }, 0.12);
  if (near) fly({ ...near, half: Math.min(2.2 * near.half, fitted().half) });
}
function fillPanel() {
  const n = role => a.role.reduce((sum, r) => sum + (r === role), 0), words = head.legend;
  choice("bodies", { solid: "solid", ghost: "see-through", hidden: "hidden" }, state.bodies, value => { state.bodies = value; recolour(); });
  let line = 0;
  if (n(SLAVE)) checkbox("slave", words[line++], colours.palette.slice(0, 3));
  if (n(MASTER)) checkbox("master", words[line++], [colours.master]);
  if (a.internal.length) checkbox("internal", words[line++], [colours.dot], true);
  checkbox("edges", "edges of cells", []);
  if (wrong) checkbox("findings", "findings", [...new Set(severity.filter(s => s === "error" || s === "warning"))].map(s => colours[s]));
  if (head.values) {
    byId("colour").hidden = false;
    const legend = value => { state.colour = value; byId("ramp").hidden = value !== "value"; };
    choice("modes", { value: head.values.onSkin ? "values" : "quality", role: "bodies, slave, master" }, state.colour, value => { legend(value); recolour(); });
    legend(state.colour);
    byId("bad").textContent = +head.values.bad.toPrecision(3);
    byId("good").textContent = +head.values.good.toPrecision(3);
    byId("what").textContent = head.values.what;
    const bar = byId("bar").getContext("2d");
    for (let k = 0; k < 256; k++) { bar.fillStyle = `rgb(${onRamp(head.values.bad + (head.values.good - head.values.bad) * k / 255).map(Math.round)})`; bar.fillRect(k, 0, 1, 1); }
  }
  const found = head.findings.map((f, k) => [k, colours[f.severity], f.message, "", false]);
  const said = found.filter(([k]) => severity[k] !== "worst"), worst = found.filter(([k]) => severity[k] === "worst");
  if (head.checked) {
    byId("findings").querySelector("h2").textContent = said.length ? `Findings (${said.length})` : "Findings";
    list("findings", said.length ? said : [[-2, null, "the check found nothing to say", "", true]], "finding", chooseFinding);
  }
  if (worst.length) list("worst", worst.map(([k, , text]) => [k, null, ...text.split("\t"), false]), "finding", chooseFinding);
  const shown = new Set();
  for (let f = 0; f < nFaces; f++) if (a.role[f] !== MARK) shown.add(a.groups[f]);
  const inSight = new Set([...shown].flatMap(c => head.combinations[c]));
  const rows = head.groups.map((g, k) => [k, null, g.name, g.cells ? `${g.cells.toLocaleString("en")} · ${g.dim}D` : "empty", !inSight.has(k)]);
  if (rows.length) list("groups", rows, "group", chooseGroup);
  byId("filter").hidden = rows.length < 13;
  byId("filter").addEventListener("input", event => list("groups", rows.filter(r => r[2].toLowerCase().includes(event.target.value.toLowerCase())), "group", chooseGroup));
  byId("hint").textContent = `${head.plane ? "Drag: move" : "Drag: turn. Right or Shift drag: move"}. Wheel or pinch: zoom. Click a face: its numbers. Keys: F fit, E edges, arrows, + and -, Esc.`;
  paintTheme();
}
function paintTheme() { root.dataset.theme = state.theme; }

// ---- start, mouse, touch and keys

if (head.plane) choice("views", { fit: "Fit" }, "", () => fly(fitted()), false);
else choice("views", { fit: "Fit", start: "Start", x: "+x", X: "−x", y: "+y", Y: "−y", z: "+z", Z: "−z" }, "", value => {
  const eyes = { start: head.eye, x: [1, 0, 0], X: [-1, 0, 0], y: [0, 1, 0], Y: [0, -1, 0], z: [0, 0, 1], Z: [0, 0, -1] };
  fly(fitted(value === "fit" ? undefined : looking(eyes[value])));
}, false);
choice("views", { theme: "Light / dark" }, "", () => { state.theme = state.theme === "dark" ? "light" : "dark"; paintTheme(); recolour(); }, false);
const apart = Math.max(0, ...Array.from({ length: head.nBodies }, (_, b) => Math.hypot(centres[4 * b], centres[4 * b + 1], centres[4 * b + 2]) / (centres[4 * b + 3] || 1)));
if (opening || (head.nBodies > 1 && apart > 0.02)) {
  state.open = hash.has("open") ? Number(hash.get("open")) : opening && head.opened ? 1 : 0;
  byId("opening").hidden = false;
  byId("open").value = state.open;
  byId("open").addEventListener("input", event => { state.open = Number(event.target.value); spread(); });
}
if (head.moments.length > 1) {
  const last = head.moments.length - 1;
  byId("time").hidden = false;
  byId("moment").max = last;
  byId("moment").addEventListener("input", event => showMoment(Number(event.target.value)));
  let playing = 0;
  byId("play").addEventListener("click", () => {
    clearInterval(playing);
    const on = byId("play").textContent === "play";
    byId("play").textContent = on ? "stop" : "play";
    if (on) playing = setInterval(() => showMoment((Number(byId("moment").value) + 1) % (last + 1)), 400);
  });
  showMoment(last);
}
const pointers = new Map();
let moved = 0, hovering = null;
const local = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
const pan = (dx, dy) => {
  const [right, up] = axes(), unit = 2 * camera.half / sides()[1];
  camera.focus = camera.focus.map((x, i) => x + unit * (dy * up[i] - dx * right[i]));
};
const turn = (dx, dy) => {
  camera.az -= dx;
  camera.el = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, camera.el + dy));
};
const zoom = (factor, [x, y]) => {
  const [w, h] = sides(), old = camera.half;
  camera.half = Math.min(20, Math.max(1e-5, camera.half * factor));
  const change = (1 - camera.half / old) * 2 * old / h, [right, up] = axes();
  camera.focus = camera.focus.map((c, i) => c + change * ((x - w / 2) * right[i] - (y - h / 2) * up[i]));
};
canvas.addEventListener("pointerdown", event => {
  canvas.setPointerCapture(event.pointerId);
  canvas.dataset.mouse = ""; // a ring shows the focus of the keyboard only
  canvas.focus({ preventScroll: true });
  pointers.set(event.pointerId, local(event));
  moved = pointers.size > 1 ? 99 : 0;
  flight++;
});
canvas.addEventListener("pointermove", event => {
  const now = local(event), before = pointers.get(event.pointerId);
  if (!before) { hover(now); return; }
  byId("tip").hidden = true;
  const dx = now[0] - before[0], dy = now[1] - before[1];
  moved += Math.abs(dx) + Math.abs(dy);
  if (pointers.size > 1) {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1], gap = p => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    zoom(gap(before) / gap(now), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2]);
    pan(dx / 2, dy / 2);
  } else if (head.plane || event.shiftKey || event.buttons & 6) pan(dx, dy);
  else turn(0.008 * dx, 0.008 * dy);
  pointers.set(event.pointerId, now);
  redraw();
});
const release = event => {
  if (pointers.delete(event.pointerId) && event.type === "pointerup" && moved < 5 && event.button === 0) pick(...local(event)).then(showDetails);
};
for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, release);
canvas.addEventListener("pointerleave", () => { hovering = null; byId("tip").hidden = true; });
canvas.addEventListener("blur", () => { delete canvas.dataset.mouse; });
canvas.addEventListener("contextmenu", event => event.preventDefault());
canvas.addEventListener("dblclick", () => fly(fitted()));
canvas.addEventListener("wheel", event => {
  event.preventDefault();
  flight++;
  zoom(Math.exp(Math.min(60, Math.max(-60, event.deltaY * (event.deltaMode ? 20 : 1))) * 0.004), local(event));
  redraw();
}, { passive: false });
let telling = false;
function hover(at) { // one question at a time: what is under the pointer when the last was answered
  hovering = at;
  if (telling) return;
  telling = true;
  requestAnimationFrame(async () => {
    for (let asked = null; hovering && hovering !== asked;) await tell(asked = hovering);
    telling = false;
  });
}
async function tell([x, y], wait = false) {
  const f = await pick(x, y, wait), tip = byId("tip");
  tip.hidden = f < 0 || hovering === null;
  if (tip.hidden) return;
  tip.replaceChildren(...describe(f).map((text, k) => make("div", text, { class: k ? "" : "first" })));
  const [w, h] = sides();
  tip.style.left = `${Math.max(4, Math.min(x + 14, w - tip.offsetWidth - 8))}px`;
  tip.style.top = `${y + 18 + tip.offsetHeight > h ? Math.max(4, y - tip.offsetHeight - 12) : y + 18}px`;
}
canvas.addEventListener("keydown", event => {
  const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
  if (step) { if (head.plane) pan(-200 * step[0], -200 * step[1]); else turn(...step); }
  else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 0.85 : 1 / 0.85, sides().map(s => s / 2));
  else if (event.key === "f" || event.key === "F") fly(fitted());
  else if (event.key === "e" || event.key === "E") state.edges = !state.edges;
  else if (event.key === "Escape") { state.finding = state.group = -1; markLists(); showDetails(-1); }
  else return;
  event.preventDefault();
  redraw();
});
byId("close").addEventListener("click", () => showDetails(-1));
byId("fold").addEventListener("click", () => byId("fold").setAttribute("aria-expanded", !document.body.classList.toggle("folded")));
new ResizeObserver(redraw).observe(canvas);

byId("message").textContent = "";
spread();
recolour();
fly(fitted(looking(hash.has("eye") ? hash.get("eye").split(",").map(Number) : head.eye)), true);
if (hash.has("group")) chooseGroup(head.groups.findIndex(g => g.name === hash.get("group")));
if (hash.has("finding")) chooseFinding(Number(hash.get("finding")));
if (hash.has("pick")) { hovering = hash.get("pick").split(",").map(Number); showDetails(await pick(...hovering, true)); await tell(hovering, true); }
root.dataset.triangles = triangles.count / 3;
root.dataset.glError = gl.getError();
root.dataset.state = "ready";
})();
