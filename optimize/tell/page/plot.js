// Plots in SVG for the page's script, which stands after this one in one function.

const namespace = document.getElementById("map").namespaceURI;

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

function drawn(parent, name, attributes, text) {
  const element = document.createElementNS(namespace, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  return parent.appendChild(element);
}

// Four digits, never rounded away before the point.
function number(value) {
  if (!Number.isFinite(value)) return "no value";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e7)) return value.toExponential(3);
  return size >= 1e4 ? Math.round(value).toLocaleString("en").replaceAll(",", "\u202f")
                     : String(Number(value.toPrecision(size >= 1e3 ? 5 : 4)));
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
  drawn(group, "rect", { x: frame.left, y: frame.top, width: frame.width,
                         height: frame.height, class: "frame" });
  for (const v of ticks(x.low, x.high, x.ticks)) {
    drawn(group, "path", { d: `M${across(v)} ${bottom}v5` });
    drawn(group, "text", { x: across(v), y: bottom + 18, "text-anchor": "middle" }, v);
  }
  for (const v of ticks(y.low, y.high, y.ticks)) {
    drawn(group, "path", { d: `M${frame.left} ${up(v)}h-5` });
    drawn(group, "text", { x: frame.left - 8, y: up(v) + 4, "text-anchor": "end" }, v);
  }
  drawn(group, "text", { x: frame.left + frame.width / 2, y: bottom + 37,
                         "text-anchor": "middle" }, x.label);
  const middle = frame.top + frame.height / 2, left = frame.left - 50;
  drawn(group, "text", { x: left, y: middle, "text-anchor": "middle",
                         transform: `rotate(-90 ${left} ${middle})` }, y.label);
  return { across, up };
}

function line(x, y, { across, up }) {
  let path = "", pen = "M";
  x.forEach((value, i) => {
    const there = Number.isFinite(value) && Number.isFinite(y[i]);
    if (there) path += `${pen}${across(value).toFixed(1)} ${up(y[i]).toFixed(1)}`;
    pen = there ? "L" : "M";
  });
  return path;
}

function dots(x, y, { across, up }) {
  return x.map((value, i) => Number.isFinite(value) && Number.isFinite(y[i])
    ? `M${across(value).toFixed(1)} ${up(y[i]).toFixed(1)}h0` : "").join("");
}
