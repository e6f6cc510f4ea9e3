// The interactive landscape. Everything it draws is in the page; nothing is fetched.
const data = JSON.parse(document.getElementById("data").textContent);
const { parameters, shape, starts, variables, motions, designs, colours } = data.landscape;
const map = document.getElementById("map");
const tip = document.getElementById("tip");
// Cells of a grid of one or two parameters, or points of a sequence in more of them.
const [acrossMap, upMap] = parameters;
const cells = acrossMap.values.length;
const columns = shape ? shape[0] : cells, rows = shape && shape.length > 1 ? shape[1] : 1;

// The numbers ---------------------------------------------------------------------------

for (const variable of variables)
  variable.values = new Float32Array(bytes(variable.packed));
const byName = Object.fromEntries(variables.map((variable) => [variable.name, variable]));

function at(name, start, cell) {
  return byName[name].values[start * cells + cell];
}

function faults(cell, start) {
  if (at("success", start, cell) === 0) return ["failed"];
  const found = at("whirl", start, cell) === 1 ? ["friction whirl"] : [];
  if (at("inside_model", start, cell) === 0) found.push("out of the contact model");
  if (at("counts", start, cell) === 0 && !found.includes("friction whirl"))
    found.push("outside a constraint");
  return found;
}

function place(cell) {
  return parameters.map(({ name, unit, values }) => `${name} ${number(values[cell])} ${unit}`.trim())
    .join(", ");
}

// What one start did in a cell, in words.
function account(cell, start) {
  const named = faults(cell, start);
  if (named[0] === "failed") return `${starts[start]} start: failed`;
  // The first force has a scatter.
  const [[leading, called], ...others] = Object.entries(data.landscape.forces);
  const rms = number(at(leading, start, cell));
  const error = at(`${leading}_error`, start, cell);
  const scatter = Number.isFinite(error) ? ` ± ${number(Number(error.toPrecision(2)))}` : "";
  const objective = at("objective", start, cell), { label, units } = byName.objective;
  // The objective is often the RMS itself.
  const other = objective === at(leading, start, cell)
    ? [] : [`${label} ${number(objective)} ${units}`];
  const further = others.map(([name, words]) => `${words} ${number(at(name, start, cell))} N`);
  return [`${starts[start]} start: ${called} ${rms}${scatter} N`, ...further, ...other, ...named]
    .join(", ");
}

function accounts(cell) {
  return starts.map((_, start) => account(cell, start));
}

// The map -------------------------------------------------------------------------------

const frame = { left: 66, top: 12, width: 460, height: 330 };
const view = { variable: "", start: "larger" };
let kept = 0;

// A cell reaches halfway to its neighbours.
function edges(points) {
  if (points.length === 1) return [points[0] - 0.5, points[0] + 0.5];
  const inner = points.slice(1).map((point, i) => (point + points[i]) / 2);
  const last = points.length - 1;
  return [2 * points[0] - inner[0], ...inner, 2 * points[last] - inner[last - 1]];
}

function gridEdges() {
  const x = acrossMap.values.filter((_, cell) => cell % rows === 0);
  return [edges(x), edges(upMap ? upMap.values.slice(0, rows) : [0])];
}

// The range of a parameter with room for the circles at its ends.
function range({ values }) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const room = 0.05 * (high - low) || 0.5;
  return [low - room, high + room];
}

function axis(parameter, limits, count) {
  const { label, unit } = parameter ?? {};
  return { low: limits[0], high: limits.at(-1), ticks: parameter ? count : 0,
           label: parameter ? `${label}${unit ? `, ${unit}` : ""}` : "" };
}

function shown(cell) {
  if (view.start !== "larger") return at(view.variable, Number(view.start), cell);
  const values = starts.map((_, start) => at(view.variable, start, cell));
  return values.every(Number.isFinite) ? Math.max(...values) : NaN;
}

function faultsShown(cell) {
  const asked = view.start === "larger" ? starts.keys() : [Number(view.start)];
  return [...asked].flatMap((start) => faults(cell, start));
}

function drawMap() {
  map.replaceChildren();
  const [x, y] = shape ? gridEdges() : [range(acrossMap), range(upMap)];
  const { across, up } = axes(map, frame, axis(acrossMap, x, 7), axis(upMap, y, 6));
  const pattern = drawn(drawn(map, "defs", {}), "pattern",
    { id: "hatch", width: 6, height: 6, patternUnits: "userSpaceOnUse" });
  drawn(pattern, "path", { d: "M0 6L6 0", class: "hatch" });
  // A whirl's numbers would leave all other cells one colour: they stay out of the scale.
  const all = Array.from({ length: cells }, (_, cell) => {
    const named = faultsShown(cell), value = shown(cell);
    const out = named.includes("failed") || named.includes("friction whirl");
    return { named, value, valid: !out && Number.isFinite(value) };
  });
  const valid = all.filter((entry) => entry.valid).map((entry) => entry.value);
  const low = valid.reduce((a, b) => Math.min(a, b), Infinity);
  const high = valid.reduce((a, b) => Math.max(a, b), -Infinity);
  const tone = (value) => (high > low ? Math.round(((value - low) / (high - low)) *
                                                   (colours.length - 1)) : 0);
  all.forEach(({ named, value, valid }, cell) => {
    const fill = valid ? colours[tone(value)] : "url(#hatch)";
    const box = shape ? gridBox(cell, x, y, across, up) : pointBox(cell, across, up);
    drawn(map, "rect", { ...box, class: "cell", "data-cell": cell, fill });
    const mark = named.includes("failed") ? "F" : named.includes("friction whirl") ? "W" : "";
    const size = Math.min(box.width, box.height);
    if (mark && size >= 7)
      drawn(map, "text", { x: box.x + box.width / 2, y: box.y + box.height / 2,
                           "font-size": Math.min(15, 0.8 * size), class: "mark" }, mark);
    if (valid && named.length && size >= 5)
      drawn(map, "circle", { cx: box.x + box.width - size / 5, cy: box.y + size / 5,
                             r: Math.min(2.5, size / 8), class: "outside" });
  });
  drawColourBar(low, high, valid.length > 0);
  for (const design of designs) {
    const [cx, cy] = [across(design.at[0]), up(design.at[1] ?? 0)];
    const inside = cx >= frame.left && cx <= frame.left + frame.width &&
                   cy >= frame.top && cy <= frame.top + frame.height;
    if (inside) drawn(map, "path", { d: `M${cx} ${cy}${design.shape}z`, class: "design" });
  }
  drawn(map, "rect", { id: "kept", class: "kept" });
  drawn(map, "rect", { id: "hovered", class: "kept hovered" });
  outline("kept", kept);
}

function gridBox(cell, x, y, across, up) {
  const [i, j] = [Math.floor(cell / rows), cell % rows];
  return { x: across(x[i]), y: up(y[j + 1]),
           width: across(x[i + 1]) - across(x[i]), height: up(y[j]) - up(y[j + 1]) };
}

function pointBox(cell, across, up) {
  return { x: across(acrossMap.values[cell]) - 7, y: up(upMap.values[cell]) - 7, rx: 7,
           width: 14, height: 14 };
}

function drawColourBar(low, high, any) {
  const { label, units } = byName[view.variable], left = frame.left + frame.width + 16;
  const bar = { left, top: frame.top, width: 16, height: frame.height };
  const step = bar.height / colours.length;
  const middle = bar.top + bar.height / 2, end = left + 92;
  drawn(map, "text", { x: end, y: middle, "text-anchor": "middle", id: "bar-label",
                       transform: `rotate(-90 ${end} ${middle})` },
        `${label}${units === "1" ? "" : `, ${units}`}`);
  if (!any) return;
  colours.forEach((colour, k) =>
    drawn(map, "rect", { x: left, y: bar.top + bar.height - (k + 1) * step, width: bar.width,
                         height: step + 0.5, fill: colour }));
  const marks = high > low ? ticks(low, high, 6) : [low];
  for (const value of marks) {
    const share = high > low ? (value - low) / (high - low) : 0;
    drawn(map, "text", { x: left + bar.width + 6, y: bar.top + bar.height * (1 - share) + 4 },
          number(value));
  }
}

function outline(id, cell) {
  const box = map.querySelector(`[data-cell="${cell}"]`);
  for (const name of ["x", "y", "width", "height", "rx"])
    document.getElementById(id).setAttribute(name, (cell !== null && box.getAttribute(name)) || 0);
}

// One cell ------------------------------------------------------------------------------

if (motions) {
  for (const name of ["x", "y", "force", "ideal"]) {
    motions[name].whole = new Int16Array(bytes(motions[name].values));
    motions[name].scales = new Float32Array(bytes(motions[name].scale));
  }
}

// One motion's samples: whole numbers of a scale of its own, -32768 where there is none.
function samples(name, which) {
  const { whole, scales } = motions[name], length = motions.turn.length;
  return Array.from(whole.subarray(which * length, (which + 1) * length),
                    (value) => (value === -32768 ? NaN : value * scales[which]));
}

function drawOrbit(svg, x, y, whirl, named) {
  const reach = [...x, ...y].reduce((a, v) => (Math.abs(v) > a ? Math.abs(v) : a), 1) * 1.08;
  const scales = axes(svg, { left: 62, top: 10, width: 190, height: 190 },
    { low: -reach, high: reach, ticks: 4, label: "to the right, clearances" },
    { low: -reach, high: reach, ticks: 4, label: "upwards, clearances" });
  drawn(svg, "circle", { cx: scales.across(0), cy: scales.up(0), class: "bore",
                         r: scales.across(1) - scales.across(0) });
  const d = whirl ? dots(x, y, scales) : line(x, y, scales);
  drawn(svg, "path", { d, class: `orbit ${named}${whirl ? " dots" : ""}` });
}

function drawForce(svg, force, ideal, top, whirl, named) {
  const { turn } = motions;
  const scales = axes(svg, { left: 62, top: 10, width: 330, height: 190 },
    { low: 0, high: turn.at(-1), ticks: 4, label: "turns of the shaft" },
    { low: 0, high: top, ticks: 5, label: `${"foundation_rms" in data.landscape.forces ? "|R_O| + |R_C|" : "shaking force"}, kN` });
  const d = whirl ? dots(turn, force, scales) : line(turn, force, scales);
  drawn(svg, "path", { d, class: `force ${named}${whirl ? " dots" : ""}` });
  drawn(svg, "path", { d: line(turn, ideal, scales), class: "ideal" });
}

function drawMotions(cell) {
  const ideal = samples("ideal", cell).map((value) => value / 1e3);
  const runs = starts.map((_, start) => {
    const which = start * cells + cell;
    return { x: samples("x", which), y: samples("y", which),
             force: samples("force", which).map((value) => value / 1e3),
             whirl: at("whirl", start, cell) === 1 };
  });
  const most = (values) => values.reduce((a, v) => (v > a ? v : a), 0);
  // One scale for both starts, unless a whirl would flatten the other.
  const shared = most(runs.filter((run) => !run.whirl).flatMap((run) => run.force));
  runs.forEach((run, start) => {
    const top = 1.06 * most([most(ideal), run.whirl ? most(run.force) : shared]) || 1;
    const [orbit, force] = ["orbit", "force"].map((kind) =>
      document.getElementById(`${kind}-${start}`));
    orbit.replaceChildren();
    force.replaceChildren();
    const there = run.force.some(Number.isFinite);
    document.getElementById(`account-${start}`).textContent =
      account(cell, start) + (there ? "" : "; no motion to draw");
    if (!there) return;
    drawOrbit(orbit, run.x, run.y, run.whirl, `start-${start}`);
    drawForce(force, run.force, ideal, top, run.whirl, `start-${start}`);
  });
}

function drawTable(cell) {
  const body = document.getElementById("numbers");
  // The objective is often one of the statistics: no row twice.
  const first = (variable, i) => variables.findIndex((v) => v.label === variable.label) === i;
  body.replaceChildren(...variables.filter(first).map((variable) => {
    const row = document.createElement("tr");
    const value = (start) => {
      const entry = at(variable.name, start, cell);
      return variable.logical ? ["no", "yes"][entry] ?? "no value" : number(entry);
    };
    const unit = variable.units === "1" ? "" : variable.units;
    for (const text of [variable.label, ...starts.map((_, start) => value(start)), unit])
      row.appendChild(document.createElement("td")).textContent = text;
    return row;
  }));
}

function drawCell(cell) {
  document.getElementById("place").textContent = place(cell);
  if (motions) drawMotions(cell);
  drawTable(cell);
}

// Mouse, touch and keyboard -------------------------------------------------------------

function keep(cell) {
  kept = cell;
  outline("kept", cell);
  drawCell(cell);
  document.getElementById("spoken").textContent = [place(cell), ...accounts(cell)].join("; ");
}

function leave() {
  if (tip.hidden) return;
  tip.hidden = true;
  outline("hovered", null);
  drawCell(kept);
}

let under = null;
map.addEventListener("pointermove", (event) => {
  const target = event.target.closest("[data-cell]");
  if (!target) { under = null; leave(); return; }
  const cell = Number(target.dataset.cell);
  if (cell !== under || tip.hidden) {
    under = cell;
    const lines = [place(cell), ...accounts(cell)];
    tip.replaceChildren(...lines.map((text) => {
      const part = document.createElement("div");
      part.textContent = text;
      return part;
    }));
    tip.hidden = false;
    outline("hovered", cell);
    drawCell(cell);
  }
  // Beside the pointer, on the map if it fits there: the motions stay in sight.
  const right = map.getBoundingClientRect().right - tip.offsetWidth;
  const above = event.clientY - tip.offsetHeight - 14;
  tip.style.left = `${Math.max(8, Math.min(event.clientX + 14, right))}px`;
  tip.style.top = `${above > 8 ? above : event.clientY + 18}px`;
});
map.addEventListener("pointerleave", () => { under = null; leave(); });
map.addEventListener("click", (event) => {
  const target = event.target.closest("[data-cell]");
  if (target) keep(Number(target.dataset.cell));
});
map.addEventListener("keydown", (event) => {
  if (event.key === "Escape") { leave(); return; }
  const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1],
                 ArrowDown: [0, -1] }[event.key];
  if (!move) return;
  event.preventDefault();
  leave();
  const bounded = (index, count) => Math.min(count - 1, Math.max(0, index));
  // Points of a sequence have no neighbours: their numbers follow each other.
  if (!shape) { keep(bounded(kept + move[0] + move[1], cells)); return; }
  const i = bounded(Math.floor(kept / rows) + move[0], columns);
  const j = bounded((kept % rows) + move[1], rows);
  keep(i * rows + j);
});
for (const name of ["variable", "start"])
  document.getElementById(`choose-${name}`).addEventListener("change", (event) => {
    view[name] = event.target.value;
    drawMap();
  });

view.variable = document.getElementById("choose-variable").value;
kept = data.landscape.first;
drawMap();
keep(kept);
