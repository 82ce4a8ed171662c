// Loads behind the five, of an estimator that gives them: those of the whole body in a line, others in tables.
import { byId, element, number, text } from "./texts.js";

/** Value and 3 sigma of an output in the unit of its column; "-" without one. */
function shown(loads, name, column) {
  const value = loads[name] ?? null, sigma = loads[`sigma.${name}`] ?? null, { factor, digits } = column;
  return value === null || sigma === null ? "-" : `${number(factor * value, digits)} ± ${number(3 * factor * sigma, digits)}`;
}

/** "C_l -0.0123 ± 0.0030, -0.456 ± 0.111 kN m" of a table of one row without a place. */
function line(table, loads) {
  const cells = table.rows[0].outputs.map((name, k) => {
    const column = table.columns[k];
    return [column.text, shown(loads, name, column), column.unit].filter((part) => part).join(" ");
  });
  return `${table.title} ${cells.join(", ")} (3 sigma)`;
}

function drawn(table, loads) {
  const made = element("table"), head = element("thead"), body = element("tbody"), first = element("tr");
  const headings = table.columns.map((column) => (column.unit ? `${column.text} [${column.unit}]` : column.text));
  first.append(...[table.place, ...headings].map((heading) => element("th", heading, { scope: "col" })));
  head.append(first);
  body.append(...table.rows.map((row) => {
    const cells = element("tr");
    cells.append(element("th", row.place, { scope: "row" }));
    cells.append(...row.outputs.map((name, k) => element("td", shown(loads, name, table.columns[k]))));
    return cells;
  }));
  made.append(element("caption", `${table.title}, ± 3 sigma`), head, body);
  return made;
}

export function drawFurtherLoads(layout, latest) {
  const tables = layout.load_tables, loads = latest.other_loads;
  byId("other_loads").hidden = tables.length === 0;
  if (tables.length === 0) return;
  const isKnown = tables.some((table) => table.rows.some((row) => row.outputs.some((name) => (loads[name] ?? null) !== null)));
  const lines = tables.filter((table) => !table.place).map((table) => line(table, loads));
  text("now_other_loads", isKnown ? lines.join("; ") : `no value: ${latest.quality_name}`);
  byId("load_tables").replaceChildren(...tables.filter((table) => table.place).map((table) => drawn(table, loads)));
}
