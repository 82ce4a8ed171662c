// The gauges on the unrolled body: strain as colour and number, state as outline and sign, one chosen by tap or key.
import { cleared, node, ticks } from "./figures.js";
import { byId, element, number, text } from "./texts.js";

const NAMED = 8;
const SIDES = { 0: "top", 90: "starboard", 180: "bottom", 270: "port" };
let marks = [];
let chosen = null;
let last = null;

/** From blue (compression) over pale to orange (tension); told apart by colour-blind people. */
function colour(share) {
  const s = Math.max(-1, Math.min(1, share)), pale = 1 - Math.abs(s);
  const part = (end) => Math.round(end + (238 - end) * pale);
  return s < 0 ? `rgb(${part(33)},${part(102)},${part(172)})` : `rgb(${part(179)},${part(88)},${part(6)})`;
}

/** State of a gauge with its reason. */
function stateOf(name, latest) {
  if (name in latest.not_used) return { state: "masked", why: latest.not_used[name] };
  if (name === latest.suspect_gauge) {
    const others = latest.suspects > 1 ? `; ${latest.suspects} cannot be distinguished` : "";
    return { state: "suspect", why: `does not fit the others${others}` };
  }
  return { state: "used", why: "" };
}

const turned = (angle) => ((angle % 360) + 360) % 360;

/** Where each gauge is drawn: by station and roll angle, side by side where they would cover each other. */
function places(gauges, names, box) {
  const known = new Map(gauges.map((gauge) => [gauge.name, gauge]));
  const isPlaced = (name) => known.has(name) && known.get(name).x !== null && known.get(name).roll_angle !== null;
  const placed = names.filter(isPlaced), others = names.filter((name) => !isPlaced(name));
  const xs = placed.map((name) => known.get(name).x);
  const low = Math.min(0, ...xs), high = Math.max(low + 0.1, ...xs);
  const rows = Math.max(1, Math.ceil(others.length / 16));
  const bottom = others.length ? box.bottom - 24 * rows : box.bottom;
  const distinct = [...new Set(xs)].sort((a, b) => a - b);
  const gap = distinct.slice(1).reduce((least, x, k) => Math.min(least, x - distinct[k]), high - low);
  const toX = (x) => box.left + 24 + (box.right - box.left - 52) * (x - low) / (high - low);
  const angles = placed.map((name) => turned(known.get(name).roll_angle)), last = Math.max(270, ...angles);
  const toY = (angle) => box.top + 10 + (bottom - box.top - 46) * turned(angle) / last;
  const width = Math.max(7, Math.min(46, toX(low + gap) - toX(low) - 4));
  const at = new Map(), ordered = [...placed].sort((a, b) => turned(known.get(a).roll_angle) - turned(known.get(b).roll_angle));
  for (const name of ordered) {
    const gauge = known.get(name), spot = { x: toX(gauge.x), y: toY(gauge.roll_angle) };
    const covers = (one) => Math.abs(one.x - spot.x) < width && Math.abs(one.y - spot.y) < 18;
    while ([...at.values()].some(covers)) spot.y += 19; // gauges at one place, as axial and hoop, lie one below the other
    at.set(name, spot);
  }
  const lowest = Math.max(0, ...[...at.values()].map((spot) => spot.y)) + 10;
  others.forEach((name, k) => {
    const x = box.left + 26 + (box.right - box.left - 50) * (k % 16) / 16;
    at.set(name, { x, y: bottom + 14 + 24 * Math.floor(k / 16) });
  });
  return { at, lowest, bottom, width: placed.length ? width : 36, low, high, toX, toY, placed: placed.length > 0 };
}

export function drawGauges(layout, latest) {
  last = { layout, latest };
  const svg = byId("gauges"), { width, height } = cleared(svg);
  const box = { left: 92, right: width - 4, top: 6, bottom: height - 32 };
  const names = Object.keys(latest.strain_um_per_m);
  const values = names.map((name) => latest.strain_um_per_m[name]).filter((value) => value !== null);
  const most = Math.max(1, ...values.map(Math.abs));
  const place = places(layout.gauges, names, box);
  if (place.lowest > place.bottom) { // crowded: a higher figure, drawn again at once
    svg.style.height = `${Math.ceil(height + 1.3 * (place.lowest - place.bottom))}px`;
    if (svg.clientHeight > height) return drawGauges(layout, latest);
  }
  if (place.placed) {
    for (const angle of [0, 90, 180, 270]) {
      const y = place.toY(angle);
      svg.append(node("line", { class: "grid", x1: box.left, x2: box.right, y1: y, y2: y }));
      svg.append(node("text", { x: box.left - 6, y: y + 4, "text-anchor": "end" }, `${SIDES[angle]} ${angle}°`));
    }
    for (const x of ticks(place.low, place.high, 7).values) {
      svg.append(node("line", { class: "tick", x1: place.toX(x), x2: place.toX(x), y1: box.bottom, y2: box.bottom + 4 }));
      svg.append(node("text", { x: place.toX(x), y: box.bottom + 15, "text-anchor": "middle" }, x.toFixed(1)));
    }
    svg.append(node("text", { x: box.right, y: box.bottom + 28, "text-anchor": "end" }, "x aft of the nose tip [m]"));
    svg.append(node("text", { x: 2, y: box.bottom + 15 }, "roll angle"));
  }
  marks = names.map((name) => {
    const { x, y } = place.at.get(name), value = latest.strain_um_per_m[name], { state, why } = stateOf(name, latest);
    const group = node("g", { class: "gauge" });
    const mark = node("rect", { class: `mark ${state}`, x: x - place.width / 2, y: y - 8, width: place.width, height: 16 });
    group.append(node("title", {}, description(name, latest)), mark);
    if (state === "masked") {
      const [l, r] = [x - place.width / 2, x + place.width / 2];
      group.append(node("path", { class: "cross", d: `M${l} ${y - 8}L${r} ${y + 8}M${r} ${y - 8}L${l} ${y + 8}` }));
    } else if (value !== null) {
      mark.style.fill = colour(value / most);
      if (place.width >= 34) {
        const isDark = Math.abs(value / most) > 0.55;
        group.append(node("text", { x, y: y + 4, class: isDark ? "light" : "" }, value.toFixed(Math.abs(value) < 9.95 ? 1 : 0)));
      }
    }
    if (state === "suspect") group.append(node("text", { x: x + place.width / 2 + 6, y: y + 5, class: "sign" }, "?"));
    group.addEventListener("click", () => choose(name));
    svg.append(group);
    return { name, x, y, group, state, why };
  });
  text("range", `${values.length ? `largest ${most.toFixed(0)} µm/m, ` : ""}${latest.gauges_used ?? values.length} of ${names.length} used`);
  text("scale_text", values.length ? `-${most.toFixed(0)} (compression) to +${most.toFixed(0)} µm/m (tension)` : "compression to tension");
  show();
  list(marks.filter((mark) => mark.state !== "used"));
}

function list(unused) {
  const byReason = new Map();
  for (const { name, state, why } of unused) {
    const key = `${state === "suspect" ? "suspect" : "not used"}: ${why}`;
    byReason.set(key, [...(byReason.get(key) || []), name]);
  }
  const lines = [...byReason].map(([reason, names]) => {
    const more = names.length > NAMED ? ` and ${names.length - NAMED} more` : "";
    return `${names.length === 1 ? "" : `${names.length} gauges `}${reason} — ${names.slice(0, NAMED).join(", ")}${more}`;
  });
  if (byId("not_used").dataset.lines === lines.join("\n")) return;
  byId("not_used").dataset.lines = lines.join("\n");
  byId("not_used").replaceChildren(...lines.map((line) => element("li", line)));
}

function description(name, latest) {
  const gauge = last.layout.gauges.find((one) => one.name === name), { state, why } = stateOf(name, latest);
  const at = gauge && gauge.x !== null ? `, x ${gauge.x.toFixed(2)} m, roll ${number(gauge.roll_angle, 0, "°")}` : "";
  const words = state === "masked" ? `not used: ${why}` : state === "suspect" ? `suspect: ${why}` : "used";
  return `${name}${at}: ${number(latest.strain_um_per_m[name], 1, " µm/m")}, ${words}`;
}

function show() {
  for (const mark of marks) mark.group.classList.toggle("chosen", mark.name === chosen);
  if (chosen !== null) text("chosen", description(chosen, last.latest));
}

function choose(name) {
  chosen = name;
  show();
}

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Choose the nearest gauge in the direction of an arrow key. */
function move(event) {
  const step = STEPS[event.key];
  if (!step || !marks.length) return;
  event.preventDefault();
  const from = marks.find((mark) => mark.name === chosen);
  if (!from) return choose(marks[0].name);
  let best = null, least = Infinity;
  for (const mark of marks) {
    const dx = mark.x - from.x, dy = mark.y - from.y, along = dx * step[0] + dy * step[1];
    const cost = along + 4 * Math.abs(step[0] ? dy : dx);
    if (along > 1 && cost < least) [best, least] = [mark, cost];
  }
  if (best) choose(best.name);
}

byId("gauges").addEventListener("keydown", move);
