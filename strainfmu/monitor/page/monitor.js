// The page of the monitor: takes the stream, keeps the last minute, and writes head, events and frame account.
import { drawGauges } from "./gauges.js";
import { drawHistories, makeCharts, SYMBOLS } from "./histories.js";
import { drawField } from "./pressure.js";
import { drawFurtherLoads } from "./other_loads.js";
import { byId, clock, duration, element, known, number, text } from "./texts.js";

const NO_NEWS = 3000; // ms without an event of the stream, which sends one a second at least
const DRAW_EVERY = 200; // ms
let content = null;
let constant = { words: { quality: {}, cause: {}, bus: {}, health: {} }, history_s: 60, flow: [], histories: [], columns: [] };
let points = [];
let field = null;
let events = [];
let heard = 0;
let waiting = false;
let drawn = 0;

/** Whether what is shown is current: live, waiting (nothing yet), gone (no bridge) or unreachable (no monitor). */
function link() {
  if (heard && performance.now() - heard > NO_NEWS) return "unreachable";
  if (content === null || content.latest === null) return "waiting";
  return content.silent ? "gone" : "live";
}

/** What an operator must know of who publishes, and of a bus that carries nothing. */
function busAlarm(latest) {
  const from = content.publishers || [];
  if (from.length > 1) return `${from.length} PUBLISHERS: ${from.join(", ")}. The results of all are mixed here: state page.token.`;
  if (latest === null || !["BUS_OFF", "DISCONNECTED"].includes(latest.bus_state)) return "";
  const fault = latest.bus.last_fault || "", isOff = latest.bus_state === "BUS_OFF" || fault === "bus off";
  const what = isOff ? "BUS OFF: the controller has left the bus" : `BUS DISCONNECTED: ${fault || "no frames"}`;
  return `${what}. The bridge opens it again, ${latest.bus.reconnects ?? 0} times so far.`;
}

function writeLink(state) {
  const latest = content === null ? null : content.latest, alarm = byId("alarm");
  document.body.dataset.link = state;
  const isOld = state === "gone" || (state === "unreachable" && latest !== null);
  document.body.classList.toggle("old", isOld);
  const at = latest === null ? "" : ` Everything below is old: of ${clock(latest.timestamp, 0)}.`;
  const since = performance.now() - heard;
  const words = {
    live: busAlarm(latest), waiting: "",
    gone: `BRIDGE GONE: nothing received for ${content && duration(content.silent_for_s + Math.max(0, since - 500) / 1e3)}.${at}`,
    unreachable: `MONITOR NOT REACHABLE for ${duration(since / 1e3)}: this page is not connected.${at}`,
  }[state];
  alarm.hidden = !words;
  text("alarm", words);
  const from = content === null ? [] : content.publishers || [];
  const received = content === null ? "" : `${content.datagrams} datagrams${from.length ? ` from ${from.join(", ")}` : ""}`;
  text("link", {
    live: latest ? `live, ${clock(latest.timestamp, 1)} · ${received}` : "",
    waiting: "no datagram yet", gone: `bridge silent · ${received}`, unreachable: "monitor not reachable, trying again",
  }[state]);
}

function writeVerdict(latest, isOld) {
  const name = latest.quality_name, badge = document.querySelector(".badge");
  text("quality", isOld ? "GONE" : name);
  text("symbol", isOld ? "✕" : SYMBOLS[name] || "");
  badge.className = `badge q q${latest.quality}`;
  text("quality_text", isOld ? `last quality ${name}` : constant.words.quality[name] || "");
  const words = latest.causes.map((cause) => `${cause}: ${constant.words.cause[cause] || "unknown cause"}`);
  if (byId("causes").dataset.shown === words.join()) return;
  byId("causes").dataset.shown = words.join();
  byId("causes").replaceChildren(...words.map((word) => element("li", word)));
}

/** May these loads be used: since when, why, how old they are, and what they are. */
function writeAnswer(answer, latest, isOld) {
  const usable = answer !== null && answer.usable && !isOld;
  byId("answer").className = `answer current ${usable ? "yes" : "no"}`;
  text("usable", usable ? "✓ LOADS USABLE" : "✕ LOADS NOT USABLE");
  text("usable_since", answer === null || isOld ? "" : `since ${clock(answer.since, 0)}`);
  const doubt = latest.age_uncertainty_ms, hidden = doubt === null ? "" : `, up to ${doubt.toFixed(1)} ms more`;
  text("usable_age", isOld ? "" : `· age ${number(latest.age_ms, 1, " ms")}${hidden}`);
  text("usable_why", isOld ? "no results come from the bridge" : answer === null ? "" : answer.why);
  byId("now_loads").replaceChildren(...Object.entries(latest.coefficients).map(([name, value]) => {
    const row = element("div"), shown = element("dd"), sigma = latest.sigma[name];
    shown.append(element("b", number(value, 4)), sigma === null ? "" : ` ± ${(3 * sigma).toFixed(4)}`);
    row.append(element("dt", name), shown);
    return row;
  }));
}

function tile(id, value, isBad, beside = "") {
  text(id, value);
  byId(id).closest("div").classList.toggle("bad", Boolean(isBad));
  if (beside !== null) text(beside.id, beside.text);
}

/** Make the tiles of the flow, before the age. */
function makeTiles(flow) {
  document.querySelectorAll(".tiles .flow").forEach((old) => old.remove());
  byId("age").closest("div").before(...flow.map((one) => {
    const made = element("div", "", { class: "flow" }), shown = element("dd");
    shown.append(element("b", one.is_needed ? "-" : "not known", { id: one.key }), " ", element("span", "", { id: `${one.key}_range` }));
    made.append(element("dt", one.label), shown);
    return made;
  }));
}

function writeTiles(layout, latest) {
  const limit = latest.envelope_score_limit, score = latest.envelope_score, valid = layout.validity;
  const total = Object.keys(latest.strain_um_per_m).length;
  const used = latest.gauges_used ?? total - Object.keys(latest.not_used).length;
  const health = latest.health_text || constant.words.health[latest.health_name] || "";
  const usable = latest.usable === 1 ? "usable" : latest.usable === 0 ? "not usable" : "";
  tile("health", latest.health_name || "-", latest.health_name && latest.health_name !== "OK", { id: "health_text", text: usable ? `${usable}: ${health}` : health });
  const suspect = latest.suspect_gauge ? `suspect: ${latest.suspect_gauge}` : latest.health_name ? "none suspect" : "";
  tile("used", `${used} of ${total}`, used < total || latest.suspect_gauge, { id: "suspect", text: suspect });
  const chiLimit = latest.chi_square_limit, chi = latest.chi_square;
  tile("chi", number(chi, 1) + (chiLimit === null ? "" : `, limit ${chiLimit.toFixed(1)}`), chi !== null && chiLimit !== null && chi > chiLimit, null);
  tile("envelope", known(score, 1) + (limit === null ? "" : `, limit ${limit.toFixed(1)}`), score !== null && limit !== null && score > limit, null);
  const of = (quantity) => (valid[quantity] ? `map: ${valid[quantity]}` : "");
  for (const one of constant.flow) {
    const held = latest[one.key] ?? null, value = held === null ? null : one.factor * held, unit = one.unit && ` ${one.unit}`;
    const shown = one.is_needed ? number(value, one.digits, unit) : known(value, one.digits, unit);
    tile(one.key, shown, one.is_needed && value === null, { id: `${one.key}_range`, text: of(one.range) });
  }
  const doubt = latest.age_uncertainty_ms;
  tile("age", number(latest.age_ms, 1, " ms"), latest.causes.includes("OLD") || latest.causes.includes("HIDDEN_DELAY"), {
    id: "age_text", text: doubt === null ? "" : `up to ${doubt.toFixed(1)} ms more may hide`,
  });
  const { bus, recording } = latest, isBusBad = latest.bus_state !== "ERROR_ACTIVE";
  const fault = bus.last_fault ? `last fault ${bus.last_fault}, reopened ${bus.reconnects ?? 0} times` : "";
  const busWords = isBusBad && constant.words.bus[latest.bus_state] !== bus.last_fault ? constant.words.bus[latest.bus_state] || "" : "";
  tile("bus", latest.bus_state, isBusBad, { id: "bus_text", text: [bus.name, busWords, fault].filter(Boolean).join(" · ") });
  const state = recording === null ? "off" : recording.failure ? "ENDED EARLY" : "on";
  const written = recording === null ? "" : `${recording.file}, ${recording.frames} frames, ${recording.lost} lost`;
  tile("recording", state, recording !== null && (recording.failure || recording.lost > 0), {
    id: "recording_text", text: recording !== null && recording.failure ? `${recording.failure} · ${written}` : written,
  });
}

function writeAccount(latest) {
  const rows = Object.entries(latest.account).map(([name, count]) => {
    const row = element("div");
    row.append(element("dt", name), element("dd", String(count)));
    row.classList.toggle("bad", name === "not accounted for" && count !== 0);
    return row;
  });
  byId("account").replaceChildren(...rows);
  const missing = latest.account["not accounted for"];
  text("account_sum", missing === 0 ? "every frame in one class" : `${missing} frames not accounted for`);
}

function writeEvents() {
  const rows = [...events].reverse().map((event) => {
    const row = element("tr", "", { class: event.level });
    const often = event.count > 1 ? ` (${event.count} times since ${clock(event.first, 0)})` : "";
    row.append(element("td", clock(event.last), { class: "time" }), element("td", (event.level === "alarm" ? "! " : "") + event.what + often), element("td", event.why));
    return row;
  });
  byId("event_rows").replaceChildren(...rows);
  text("event_count", `${events.length}, newest first`);
}

function choices() {
  const value = (name) => document.querySelector(`input[name=${name}]:checked`).value;
  return { view: value("view"), span: Number(value("span")) };
}

function draw() {
  waiting = false;
  drawn = performance.now();
  const state = link();
  writeLink(state);
  if (content === null || content.latest === null) return;
  const { layout, latest } = content;
  text("vehicle", layout.vehicle || "");
  writeAnswer(content.answer, latest, state === "gone" || state === "unreachable");
  writeVerdict(latest, state === "gone" || state === "unreachable");
  writeTiles(layout, latest);
  drawGauges(layout, latest);
  drawField(field, latest);
  drawHistories(constant, content, points, choices());
  drawFurtherLoads(layout, latest);
  writeAccount(latest);
}

/** Draw soon, but not more often than an eye needs. */
function redraw() {
  if (waiting) return;
  waiting = true;
  setTimeout(() => requestAnimationFrame(draw), Math.max(0, DRAW_EVERY - (performance.now() - drawn)));
}

function take(news) {
  if (news.words) {
    constant = news;
    points = [];
    makeTiles(constant.flow);
    makeCharts(constant.histories);
  }
  points.push(...news.points);
  while (points.length && points[points.length - 1][0] - points[0][0] > constant.history_s) points.shift();
  if (news.events) {
    events = news.events;
    writeEvents();
  }
  content = news;
  if ("field" in news) { // at the rate of its datagrams
    field = news.field;
    if (news.latest !== null) requestAnimationFrame(() => drawField(field, content.latest));
  }
  heard = performance.now();
  redraw();
}

makeCharts([]);
const stream = new EventSource("events");
stream.onmessage = (event) => take(JSON.parse(event.data));
setInterval(() => { if (link() !== "live") redraw(); }, 500);
window.addEventListener("resize", redraw);
for (const input of document.querySelectorAll("input")) input.addEventListener("change", redraw);
new ResizeObserver(redraw).observe(byId("gauges"));
