// The map of periodic orbits. Everything it draws is in the page; nothing is fetched.
const data = JSON.parse(document.getElementById("data").textContent);
const { parameters, shape, variables, motions, designs, colours, hatched, states } = data;
const byId = (id) => document.getElementById(id);
const map = byId("map"), tip = byId("tip"), choice = byId("choose");
// Cells of a grid of one or two parameters, or points of a sequence in more of them.
const [acrossMap, upMap] = parameters;
const cells = acrossMap.values.length;
const columns = shape ? shape[0] : cells, rows = shape && shape.length > 1 ? shape[1] : 1;

// Numbers -------------------------------------------------------------------------------

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

for (const variable of variables) variable.values = new Float32Array(bytes(variable.packed));
for (const motion of Object.values(motions ?? {})) {
  motion.whole = new Int16Array(bytes(motion.values));
  motion.scales = new Float32Array(bytes(motion.scale));
}
const byName = Object.fromEntries(variables.map((variable) => [variable.name, variable]));

// A cell's samples: whole numbers of a scale of its own, -32768 where there is none.
function samples({ whole, scales }, cell) {
  const length = whole.length / cells;
  return Array.from(whole.subarray(cell * length, (cell + 1) * length),
                    (value) => (value === -32768 ? NaN : value * scales[cell]));
}

// Four digits, and all of those before the point below ten million, as everywhere else.
function number(value) {
  if (!Number.isFinite(value)) return "no value";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return value.toExponential(3);
  return String(size >= 1e3 ? Math.round(value) : Number(value.toPrecision(4)));
}

function said(variable, cell) {
  return `${number(variable.values[cell])} ${variable.units}`.trim();
}

function place(cell) {
  return parameters.map(({ label, unit, values }) => `${label} ${number(values[cell])} ${unit}`.trim())
    .join(", ");
}

// What a cell's orbit is, in words.
function account(cell) {
  const { label } = byName.objective;
  return Number.isFinite(byName.objective.values[cell])
    ? [`${label} ${said(byName.objective, cell)}`, states[cell]] : [states[cell]];
}

// The command that names a motion without a stable orbit.
function command(cell) {
  if (!data.more) return "python -m jaxcrusher regimes --help";
  const free = parameters.map(({ name, unit, values }) =>
    ` --set ${name} "${`${Number(values[cell].toPrecision(6))} ${unit}`.trim()}"`);
  return data.more + free.join("");
}

// Plots ---------------------------------------------------------------------------------

function drawn(parent, name, attributes, text) {
  const element = document.createElementNS(map.namespaceURI, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return parent.appendChild(element);
}

function ticks(low, high, count) {
  if (count === 0) return [];
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= rough);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
    found.push(Number((k * step).toPrecision(12)));
  return found;
}

// Axes of a plot in the rectangle {left, top, width, height}; returns both scales.
function axes(svg, frame, x, y) {
  const across = (v) => frame.left + ((v - x.low) / (x.high - x.low)) * frame.width;
  const up = (v) => frame.top + frame.height - ((v - y.low) / (y.high - y.low)) * frame.height;
  const bottom = frame.top + frame.height, group = drawn(svg, "g", { class: "axes" });
  drawn(group, "rect", frame);
  group.firstChild.setAttribute("x", frame.left);
  group.firstChild.setAttribute("y", frame.top);
  for (const v of ticks(x.low, x.high, x.ticks)) {
    drawn(group, "path", { d: `M${across(v)} ${bottom}v5` });
    drawn(group, "text", { x: across(v), y: bottom + 18, "text-anchor": "middle" }, v);
  }
  for (const v of ticks(y.low, y.high, y.ticks)) {
    drawn(group, "path", { d: `M${frame.left} ${up(v)}h-5` });
    drawn(group, "text", { x: frame.left - 8, y: up(v) + 4, "text-anchor": "end" }, v);
  }
  label(group, frame.left + frame.width / 2, bottom + 37, x.label, 0);
  label(group, frame.left - 50, frame.top + frame.height / 2, y.label, -90);
  return { across, up };
}

function label(parent, x, y, text, turned) {
  drawn(parent, "text", { x, y, "text-anchor": "middle",
                          transform: `rotate(${turned} ${x} ${y})` }, text);
}

function line(x, y, { across, up }) {
  return x.map((v, i) => `${i ? "L" : "M"}${across(v).toFixed(1)} ${up(y[i]).toFixed(1)}`).join("");
}

// The map -------------------------------------------------------------------------------

const frame = { left: 66, top: 12, width: 460, height: 330 };
let kept = data.first;

// A cell reaches halfway to its neighbours.
function edges(points) {
  if (points.length === 1) return [points[0] - 0.5, points[0] + 0.5];
  const inner = points.slice(1).map((point, i) => (point + points[i]) / 2);
  const last = points.length - 1;
  return [2 * points[0] - inner[0], ...inner, 2 * points[last] - inner[last - 1]];
}

// The range of a parameter with room for the circles at its ends.
function range({ values }) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const room = 0.05 * (high - low) || 0.5;
  return [low - room, high + room];
}

const [xEdges, yEdges] = shape
  ? [edges(acrossMap.values.filter((_, cell) => cell % rows === 0)),
     edges(upMap ? upMap.values.slice(0, rows) : [0])]
  : [range(acrossMap), range(upMap)];

function axis(parameter, limits) {
  const { label, unit } = parameter ?? {};
  return { low: limits[0], high: limits.at(-1), ticks: parameter ? 6 : 0,
           label: parameter ? `${label}${unit ? `, ${unit}` : ""}` : "" };
}

function box(cell, { across, up }) {
  if (!shape)
    return { x: across(acrossMap.values[cell]) - 7, y: up(upMap.values[cell]) - 7, rx: 7,
             width: 14, height: 14 };
  const [i, j] = [Math.floor(cell / rows), cell % rows];
  return { x: across(xEdges[i]), y: up(yEdges[j + 1]),
           width: across(xEdges[i + 1]) - across(xEdges[i]),
           height: up(yEdges[j]) - up(yEdges[j + 1]) };
}

function drawMap() {
  map.replaceChildren();
  const variable = variables[Number(choice.value)];
  const scales = axes(map, frame, axis(acrossMap, xEdges), axis(upMap, yEdges));
  const pattern = drawn(drawn(map, "defs", {}), "pattern",
    { id: "hatch", width: 6, height: 6, patternUnits: "userSpaceOnUse" });
  drawn(pattern, "path", { d: "M0 6L6 0", class: "hatch" });
  // What is hatched stays out of the scale.
  const values = Array.from(variable.values, (v, cell) => (hatched[cell] ? NaN : v));
  const valid = values.filter(Number.isFinite);
  const low = valid.reduce((a, b) => Math.min(a, b), Infinity);
  const high = valid.reduce((a, b) => Math.max(a, b), -Infinity);
  values.forEach((value, cell) => {
    const share = high > low ? (value - low) / (high - low) : 0, at = box(cell, scales);
    const fill = Number.isFinite(value) ? colours[Math.round(share * (colours.length - 1))]
                                        : "url(#hatch)";
    drawn(map, "rect", { ...at, class: "cell", "data-cell": cell, fill });
    const size = Math.min(at.width, at.height);
    if (!hatched[cell] && states[cell].includes("out") && size >= 5)
      drawn(map, "circle", { cx: at.x + at.width - size / 5, cy: at.y + size / 5,
                             r: Math.min(2.5, size / 8), class: "outside" });
  });
  if (valid.length) drawColourBar(variable, low, high);
  for (const { at, optimum } of designs) {
    const [x, y] = [scales.across(at[0]), scales.up(at[1] ?? 0)];
    const d = optimum ? "m0 -10l2.4 6.8h7.1l-5.7 4.3l2.1 6.9l-5.9 -4.1l-5.9 4.1l2.1 -6.9l-5.7 -4.3h7.1"
                      : "m-7 0l7 -7l7 7l-7 7";
    if (x >= frame.left && x <= frame.left + frame.width && y >= frame.top &&
        y <= frame.top + frame.height)
      drawn(map, "path", { d: `M${x} ${y}${d}z`, class: "design" });
  }
  drawn(map, "rect", { id: "kept" });
  drawn(map, "rect", { id: "hovered" });
  outline("kept", kept);
}

function drawColourBar({ label: words, units }, low, high) {
  const left = frame.left + frame.width + 16, step = frame.height / colours.length;
  const bottom = frame.top + frame.height;
  label(map, left + 92, frame.top + frame.height / 2, `${words}${units && `, ${units}`}`, -90);
  colours.forEach((fill, k) =>
    drawn(map, "rect", { x: left, y: bottom - (k + 1) * step, width: 16, height: step + 0.5, fill }));
  for (const value of high > low ? ticks(low, high, 6) : [low])
    drawn(map, "text", { x: left + 22, y: bottom + 4 - frame.height * ((value - low) / (high - low) || 0) },
          number(value));
}

function outline(id, cell) {
  const at = map.querySelector(`[data-cell="${cell}"]`);
  for (const name of ["x", "y", "width", "height", "rx"])
    byId(id).setAttribute(name, at?.getAttribute(name) ?? 0);
}

// One cell ------------------------------------------------------------------------------

function drawMotion(cell) {
  const path = samples(motions.path, cell), count = data.instants;
  const kilo = (motion) => samples(motion, cell).map((value) => value / 1e3);
  const [force, ideal] = [kilo(motions.force), kilo(motions.ideal_force)];
  const [x, y] = [path.slice(0, count), path.slice(count)];
  byId("orbit").replaceChildren();
  byId("force").replaceChildren();
  const there = force.every(Number.isFinite), closed = (values) => [...values, values[0]];
  const reach = 1.08 * (there ? path : [1]).reduce((a, v) => Math.max(a, Math.abs(v)), 1);
  const sides = { low: -reach, high: reach, ticks: 4 };
  const plane = axes(byId("orbit"), { left: 62, top: 10, width: 190, height: 190 },
    { ...sides, label: "to the right, clearances" }, { ...sides, label: "upwards, clearances" });
  drawn(byId("orbit"), "circle", { cx: plane.across(0), cy: plane.up(0), class: "ideal",
                                   r: plane.across(1) - plane.across(0) });
  const turn = Array.from({ length: count + 1 }, (_, i) => i / count);
  const all = [...ideal, ...(there ? force : [])];
  const scales = axes(byId("force"), { left: 62, top: 10, width: 330, height: 190 },
    { low: 0, high: 1, ticks: 4, label: "turns of the shaft" },
    { low: 0, high: 1.06 * Math.max(...all), ticks: 5, label: `${data.force}, kN` });
  if (there) {
    drawn(byId("orbit"), "path", { d: line(closed(x), closed(y), plane), class: "orbit" });
    drawn(byId("force"), "path", { d: line(turn, closed(force), scales), class: "force" });
  }
  drawn(byId("force"), "path", { d: line(turn, closed(ideal), scales), class: "ideal" });
}

function drawCell(cell) {
  byId("place").textContent = place(cell);
  byId("state").replaceChildren(`${states[cell]}.`);
  if (hatched[cell]) {
    byId("state").append(" More by ", document.createElement("code"));
    byId("state").lastChild.textContent = command(cell);
  }
  if (motions) drawMotion(cell);
  // The objective is often one of the statistics: no row twice.
  const first = (one, i) => variables.findIndex((other) => other.label === one.label) === i;
  byId("numbers").replaceChildren(...variables.filter(first).map((variable) => {
    const row = document.createElement("tr");
    const heading = row.appendChild(document.createElement("th"));
    heading.scope = "row";
    heading.textContent = variable.label;
    row.appendChild(document.createElement("td")).textContent = said(variable, cell);
    return row;
  }));
}

// Mouse, touch and keyboard -------------------------------------------------------------

function keep(cell) {
  kept = cell;
  outline("kept", cell);
  drawCell(cell);
  byId("spoken").textContent = [place(cell), ...account(cell)].join("; ");
}

function leave() {
  if (tip.hidden) return;
  tip.hidden = true;
  outline("hovered", null);
  drawCell(kept);
}

const cellOf = (event) => event.target.closest("[data-cell]")?.dataset.cell;
map.addEventListener("pointermove", (event) => {
  if (cellOf(event) === undefined) { leave(); return; }
  const cell = Number(cellOf(event));
  if (tip.hidden || tip.dataset.cell !== String(cell)) {
    tip.replaceChildren(...[place(cell), ...account(cell)].map((text) => {
      const part = document.createElement("div");
      part.textContent = text;
      return part;
    }));
    tip.hidden = false;
    tip.dataset.cell = cell;
    outline("hovered", cell);
    drawCell(cell);
  }
  // Beside the pointer, on the map if it fits there: the motions stay in sight.
  const right = map.getBoundingClientRect().right - tip.offsetWidth;
  const above = event.clientY - tip.offsetHeight - 14;
  tip.style.left = `${Math.max(8, Math.min(event.clientX + 14, right))}px`;
  tip.style.top = `${above > 8 ? above : event.clientY + 18}px`;
});
map.addEventListener("pointerleave", leave);
map.addEventListener("click", (event) => {
  if (cellOf(event) !== undefined) keep(Number(cellOf(event)));
});
map.addEventListener("keydown", (event) => {
  const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1],
                 ArrowDown: [0, -1] }[event.key];
  if (event.key === "Escape" || move) leave();
  if (event.key === "Escape") keep(data.first);
  if (!move) return;
  event.preventDefault();
  const bounded = (index, count) => Math.min(count - 1, Math.max(0, index));
  // Points of a sequence have no neighbours: their numbers follow each other.
  if (!shape) { keep(bounded(kept + move[0] + move[1], cells)); return; }
  const i = bounded(Math.floor(kept / rows) + move[0], columns);
  keep(i * rows + bounded((kept % rows) + move[1], rows));
});
choice.addEventListener("change", drawMap);

drawMap();
keep(kept);
