// The pressure on the unrolled body: pale is low, dark is high; hidden while the bridge sends none.
import { cleared, node, ticks } from "./figures.js";
import { byId, text } from "./texts.js";

const OLD = 1.5; // s after which a field is not that of the strains beside it
const SIDES = { 0: "top", 90: "starboard", 180: "bottom", 270: "port" };
const ENDS = [[247, 251, 255], [107, 174, 214], [8, 48, 107]]; // lightness falls all the way
const COLUMNS = 240;

/** Colour of a part of the range from 0 to 1. */
function colour(part) {
  const at = 2 * Math.max(0, Math.min(1, part)), low = Math.min(1, Math.floor(at));
  return ENDS[low].map((value, k) => Math.round(value + (ENDS[low + 1][k] - value) * (at - low)));
}

/** The field as a picture: stations where they are along x, a row for each roll angle. */
function picture({ x, roll_angle, pressure_Pa }, least, most) {
  const canvas = document.createElement("canvas"), rows = roll_angle.length;
  [canvas.width, canvas.height] = [COLUMNS, rows];
  const context = canvas.getContext("2d"), image = context.createImageData(COLUMNS, rows);
  let station = 0;
  for (let column = 0; column < COLUMNS; column++) {
    const at = x[0] + (x[x.length - 1] - x[0]) * column / (COLUMNS - 1);
    while (station + 1 < x.length && Math.abs(x[station + 1] - at) <= Math.abs(x[station] - at)) station++;
    for (let row = 0; row < rows; row++) {
      const part = (pressure_Pa[station * rows + row] - least) / Math.max(1, most - least);
      image.data.set([...colour(part), 255], 4 * (row * COLUMNS + column));
    }
  }
  context.putImageData(image, 0, 0);
  return canvas.toDataURL();
}

export function drawField(field, latest) {
  const values = field ? field.pressure_Pa : [], isOld = field && Math.abs(latest.timestamp - field.timestamp) > OLD;
  byId("field_section").hidden = !field;
  if (!field) return;
  if (!values.length || isOld) {
    byId("field").replaceChildren();
    text("field_range", "no estimate");
    return;
  }
  const svg = byId("field"), { width, height } = cleared(svg);
  const box = { left: 92, right: width - 4, top: 6, bottom: height - 32 };
  const least = Math.min(...values), most = Math.max(...values), { x, roll_angle } = field;
  const href = picture(field, least, most);
  const size = { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top };
  svg.append(node("image", { href, preserveAspectRatio: "none", ...size }));
  const toY = (angle) => box.top + size.height * (angle + 180 / roll_angle.length) / 360;
  for (const angle of [0, 90, 180, 270]) {
    svg.append(node("text", { x: box.left - 6, y: toY(angle) + 4, "text-anchor": "end" }, `${SIDES[angle]} ${angle}°`));
  }
  for (const at of ticks(x[0], x[x.length - 1], 7).values) {
    const place = box.left + size.width * (at - x[0]) / (x[x.length - 1] - x[0]);
    svg.append(node("line", { class: "tick", x1: place, x2: place, y1: box.bottom, y2: box.bottom + 4 }));
    const anchor = place > box.right - 12 ? "end" : "middle";
    svg.append(node("text", { x: place, y: box.bottom + 15, "text-anchor": anchor }, at.toFixed(1)));
  }
  svg.append(node("text", { x: box.right, y: box.bottom + 28, "text-anchor": "end" }, "x aft of the nose tip [m]"));
  text("field_range", `${(least / 1e3).toFixed(2)} kPa (pale) to ${(most / 1e3).toFixed(2)} kPa (dark)`);
}
