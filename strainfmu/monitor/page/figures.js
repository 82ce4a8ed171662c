// Parts of figures: SVG elements, round ticks, axes.
export function node(name, attributes, content) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (content !== undefined) made.textContent = content;
  return made;
}

/** Clear a figure and return its size [px]: it is drawn as large as it is shown, so that texts keep their size. */
export function cleared(svg) {
  const width = Math.max(svg.clientWidth, 240), height = Math.max(svg.clientHeight, 30);
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.replaceChildren();
  return { width, height };
}

/** Round numbers from low to high, about `count` of them. */
export function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { values: found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

/** Draw the vertical axis of `box` with its grid; `toY` from value to pixel. */
export function verticalAxis(svg, box, values, label, toY) {
  for (const value of values) {
    const y = toY(value).toFixed(1);
    svg.append(node("line", { class: "grid", x1: box.left, x2: box.right, y1: y, y2: y }));
    svg.append(node("text", { x: box.left - 5, y: +y + 4, "text-anchor": "end" }, label(value)));
  }
  svg.append(node("rect", { class: "frame", x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top }));
}

/** Draw the axis of time before now below `box`: seconds, the last point at the right. */
export function timeAxis(svg, box, span) {
  const parts = box.right - box.left < 300 ? 3 : 6, every = span / parts < 10 ? Math.max(2, span / 5) : span / parts;
  const last = document.body.classList.contains("old") ? "last" : "now";
  for (let back = 0; back <= span; back += every) {
    const x = box.right - (box.right - box.left) * back / span;
    svg.append(node("line", { class: "tick", x1: x, x2: x, y1: box.bottom, y2: box.bottom + 4 }));
    const anchor = back === 0 ? "end" : back >= span ? "start" : "middle";
    svg.append(node("text", { x, y: box.bottom + 15, "text-anchor": anchor }, back === 0 ? last : `-${back} s`));
  }
}
