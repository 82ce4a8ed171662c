// Rolling moment and loads of sections along the body, of an estimator that gives them.
import { byId, element, number, text } from "./texts.js";

const LOADS = ["axial", "normal", "side", "pitch", "yaw", "torsion"];

/** Value and 3 sigma of a load, as a text; "-" without one. */
function shown(loads, name, factor, digits) {
  const value = loads[name] ?? null, sigma = loads[`sigma.${name}`] ?? null;
  return value === null || sigma === null ? "-" : `${number(factor * value, digits)} ± ${number(3 * factor * sigma, digits)}`;
}

export function drawSections(layout, latest) {
  const stations = layout.section_stations_m, loads = latest.further_loads;
  byId("sections").hidden = stations === null;
  if (stations === null) return;
  const isKnown = (loads.M_R ?? null) !== null;
  const roll = `C_l ${shown(loads, "M_R", 1, 4)}, ${shown(loads, "moment.roll", 1e-3, 3)} kN m (3 sigma)`;
  text("now_rolling", isKnown ? roll : `no value: ${latest.quality_name}`);
  byId("section_table").hidden = stations.length === 0;
  const rows = stations.map((station, index) => {
    const row = element("tr");
    row.append(element("th", station.toString(), { scope: "row" }));
    row.append(...LOADS.map((name) => element("td", shown(loads, `section.${name}[${index + 1}]`, 1e-3, 3))));
    return row;
  });
  byId("section_rows").replaceChildren(...rows);
}
