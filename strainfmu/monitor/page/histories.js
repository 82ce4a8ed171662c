// Values over time: estimate with its 3 sigma band coloured by quality, limits, chi-square, the strip of qualities.
import { cleared, node, ticks, timeAxis, verticalAxis } from "./figures.js";
import { byId, element, number, text } from "./texts.js";

export const QUALITIES = ["NO_DATA", "VALID", "UNPROTECTED", "DEGRADED", "SUSPECT", "STALE", "INVALID", "UNCONFIRMED"];
export const SYMBOLS = { NO_DATA: "–", VALID: "✓", UNPROTECTED: "○", DEGRADED: "!", SUSPECT: "?", STALE: "…", INVALID: "✕", UNCONFIRMED: "~" };
const GAP = 0.6; // s without a point: a gap in the line
const [TIME, QUALITY, CHI, CHI_LIMIT] = [0, 1, 2, 3];

/** Make the chart of each of `histories`, and the legend, in place of those before. */
export function makeCharts(histories) {
  byId("charts").replaceChildren();
  byId("quality_legend").replaceChildren();
  histories.forEach(({ name }) => {
    const section = element("section", "", { class: "current", "aria-labelledby": `h_${name}` });
    const title = element("h2", "", { id: `h_${name}` });
    title.append(element("span", name, { id: `title_${name}` }), element("span", "", { id: `range_${name}`, class: "range" }));
    title.append(element("span", "-", { id: `now_${name}`, class: "now" }));
    const svg = node("svg", { id: `chart_${name}`, role: "img", "aria-label": `${name} over time with 3 sigma` });
    section.append(title, svg);
    byId("charts").append(section);
  });
  for (const name of QUALITIES) {
    const item = element("li"), swatch = node("svg", { width: 30, height: 14 });
    swatch.append(...block(0, 30, 14, QUALITIES.indexOf(name)));
    item.append(swatch, document.createTextNode(name));
    byId("quality_legend").append(item);
  }
}

/** A block of the strip: colour, and the quality's symbol where there is room. */
function block(x, width, height, quality) {
  const made = [node("rect", { class: `block q${quality}`, x, y: 0, width: Math.max(width, 2), height })];
  if (width >= 12) {
    const sign = node("text", { x: x + width / 2, y: height / 2 + 4, "text-anchor": "middle", class: "block_sign" }, SYMBOLS[QUALITIES[quality]]);
    made.push(sign);
  }
  return made;
}

/** Runs of neighbouring points without a gap and of one quality; each run begins with the last point of the one before. */
function runs(points, isShown, byQuality = true) {
  const found = [];
  let run = null;
  for (const point of points) {
    if (!isShown(point)) {
      run = null;
      continue;
    }
    const before = run ? run.points[run.points.length - 1] : null;
    if (before && point[TIME] - before[TIME] <= GAP) {
      if (byQuality && point[QUALITY] !== run.quality) found.push((run = { quality: point[QUALITY], points: [before] }));
    } else {
      found.push((run = { quality: point[QUALITY], points: [] }));
    }
    run.points.push(point);
  }
  return found;
}

function frame(svg, left) {
  const { width, height } = cleared(svg);
  return { left, right: width - 6, top: 6, bottom: height - 20 };
}

/** Show one quantity: `column` of its value, `deviation` of its sigma, both times `factor`. */
function drawHistory(svg, points, { end, span, column, deviation, factor, range }) {
  const box = frame(svg, 56);
  const recent = points.filter((point) => point[TIME] >= end - span - GAP);
  const seen = recent.filter((point) => point[column] !== null && point[deviation] !== null);
  const toX = (time) => box.right - (box.right - box.left) * Math.min(1, Math.max(0, (end - time) / span));
  let low = Infinity, high = -Infinity;
  for (const point of seen) {
    low = Math.min(low, factor * (point[column] - 3 * point[deviation]));
    high = Math.max(high, factor * (point[column] + 3 * point[deviation]));
  }
  if (!seen.length) [low, high] = range || [-1, 1];
  const margin = 0.06 * (high - low) || 1e-6 * Math.max(1, Math.abs(high));
  [low, high] = [low - margin, high + margin];
  const toY = (value) => box.bottom - (box.bottom - box.top) * (value - low) / (high - low);
  const { values, digits } = ticks(low, high, 5);
  verticalAxis(svg, box, values, (value) => (Math.abs(value) < 1e-12 ? 0 : value).toFixed(digits), toY);
  timeAxis(svg, box, span);
  for (const bound of range || []) {
    if (bound < low || bound > high) continue;
    svg.append(node("line", { class: "limit", x1: box.left, x2: box.right, y1: toY(bound), y2: toY(bound) }));
    const isUp = toY(bound) < box.top + 14;
    svg.append(node("text", { class: "limit_text", x: box.left + 4, y: toY(bound) + (isUp ? 12 : -4) }, "limit of the map"));
  }
  for (const run of runs(recent, (point) => point[column] !== null && point[deviation] !== null)) {
    const at = (point, sign) => {
      const value = factor * (point[column] + 3 * sign * point[deviation]);
      return `${toX(point[TIME]).toFixed(1)},${toY(value).toFixed(1)}`;
    };
    const [upper, middle, lower] = [1, 0, -1].map((sign) => run.points.map((point) => at(point, sign)).join(" "));
    const back = lower.split(" ").reverse().join(" "), quality = `q${run.quality}`;
    svg.append(node("polygon", { class: `band ${quality}`, points: `${upper} ${back}` }));
    for (const edge of [upper, lower]) svg.append(node("polyline", { class: `edge ${quality}`, points: edge }));
    svg.append(node("polyline", { class: `line ${quality}`, points: middle }));
  }
  if (!seen.length) svg.append(node("text", { x: (box.left + box.right) / 2, y: (box.top + box.bottom) / 2, "text-anchor": "middle" }, "no values"));
}

/** Chi-square on a logarithmic axis: its alarms are far above what is usual. */
function drawChiSquare(points, latest, end, span) {
  const svg = byId("chart_chi"), box = frame(svg, 56);
  const recent = points.filter((point) => point[TIME] >= end - span - GAP && point[CHI] !== null && point[CHI] > 0);
  const limit = latest.chi_square_limit, limited = recent.filter((point) => point[CHI_LIMIT]);
  const values = recent.map((point) => point[CHI]).concat(limited.map((point) => point[CHI_LIMIT]));
  const low = Math.log10(Math.max(1e-3, Math.min(...values, 10))) - 0.1, high = Math.log10(Math.max(...values, 100)) + 0.15;
  const toX = (time) => box.right - (box.right - box.left) * Math.min(1, Math.max(0, (end - time) / span));
  const toY = (value) => box.bottom - (box.bottom - box.top) * (Math.log10(value) - low) / (high - low);
  const marked = [], every = Math.max(1, Math.ceil((high - low) / 5));
  for (let power = Math.floor(low); power <= high; power += every) {
    marked.push(...(high - low < 2.5 ? [1, 2, 5] : [1]).map((factor) => factor * 10 ** power));
  }
  verticalAxis(svg, box, marked.filter((value) => value >= 10 ** low && value <= 10 ** high), (value) => (value >= 1e5 || value < 0.01 ? value.toExponential(0) : String(+value.toPrecision(3))), toY);
  timeAxis(svg, box, span);
  for (const run of runs(recent, () => true)) {
    const path = run.points.map((point) => `${toX(point[TIME]).toFixed(1)},${toY(point[CHI]).toFixed(1)}`);
    svg.append(node("polyline", { class: `line q${run.quality}`, points: path.join(" ") }));
  }
  // The limit follows the gauges in use and, for errors in proportion to strain, the load.
  for (const run of runs(limited, () => true, false)) {
    const path = run.points.map((point) => `${toX(point[TIME]).toFixed(1)},${toY(point[CHI_LIMIT]).toFixed(1)}`);
    svg.append(node("polyline", { class: "limit", points: path.join(" ") }));
  }
  if (limited.length) {
    const first = limited[0], y = toY(first[CHI_LIMIT]) - 5;
    svg.append(node("text", { class: "limit_text", x: Math.max(box.left + 4, Math.min(toX(first[TIME]), box.right - 40)), y: Math.max(y, box.top + 11) }, "limit"));
  }
  const now = latest.chi_square, isAbove = limit && now !== null && now > limit;
  text("now_chi", now === null ? "no estimate" : `${now.toFixed(1)} [1]${limit ? `, limit ${limit.toFixed(1)}` : ""}${isAbove ? ": above its limit" : ""}`);
}

function drawStrip(points, end, span) {
  const svg = byId("strip"), { width } = cleared(svg), height = 18, left = 56, right = width - 6;
  const toX = (time) => right - (right - left) * Math.min(1, Math.max(0, (end - time) / span));
  const recent = points.filter((point) => point[TIME] >= end - span - GAP), counts = new Map();
  svg.append(node("rect", { class: "frame", x: left, y: 0, width: right - left, height }));
  for (const run of runs(recent, () => true)) {
    const [first, last] = [run.points[0][TIME], run.points[run.points.length - 1][TIME]];
    svg.append(...block(toX(first), toX(last) - toX(first), height, run.quality ?? 0));
    counts.set(run.quality, (counts.get(run.quality) || 0) + 1);
  }
  timeAxis(svg, { left, right, bottom: height }, span);
  const bad = recent.filter((point) => point[QUALITY] !== 1 && point[QUALITY] !== 2).length;
  text("now_strip", `${recent.length ? (100 * (1 - bad / recent.length)).toFixed(1) : "-"} % of the time VALID or UNPROTECTED`);
}

export function drawHistories({ histories, columns }, content, points, { view, span }) {
  const latest = content.latest, ranges = content.layout.coefficient_range;
  const end = points.length ? Math.max(points[points.length - 1][TIME], latest.timestamp) : latest.timestamp;
  histories.forEach((one) => {
    const isLoad = view === "loads", { name } = one, shownName = isLoad ? one.load : name;
    const factor = isLoad ? one.load_factor : 1;
    const [column, deviation] = [shownName, `sigma.${shownName}`].map((held) => columns.indexOf(held));
    text(`title_${name}`, isLoad ? one.load_title : one.title);
    const range = isLoad ? null : ranges[name] || null;
    text(`range_${name}`, range ? `, map ${range[0].toPrecision(3)} to ${range[1].toPrecision(3)}` : "");
    const value = isLoad ? latest.loads[shownName] : latest.coefficients[name];
    const sigma = isLoad ? latest.loads_sigma[shownName] : latest.sigma[name];
    const digits = isLoad ? 3 : 4, isKnown = value !== null && value !== undefined && sigma !== null && sigma !== undefined;
    const shown = isKnown ? `${number(factor * value, digits)} ± ${number(3 * factor * sigma, digits)} (3 sigma)` : `no value: ${latest.quality_name}`;
    text(`now_${name}`, shown);
    drawHistory(byId(`chart_${name}`), points, {
      end, span, column, deviation, factor, range,
    });
  });
  drawChiSquare(points, latest, end, span);
  drawStrip(points, end, span);
}
