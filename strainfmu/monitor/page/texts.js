// Numbers and times as texts, and the element that shows them.
export const byId = (id) => document.getElementById(id);

/** Write a text where it has changed: what is read aloud is not read again. */
export function text(id, value) {
  const shown = byId(id);
  if (shown.textContent !== value) shown.textContent = value;
}

export const number = (value, digits, unit = "") =>
  value === null || value === undefined ? "-" : value.toFixed(digits) + unit;

export const known = (value, digits, unit = "") =>
  value === null || value === undefined ? "not known" : value.toFixed(digits) + unit;

/** Time of day of a time since 1970 [s]. */
export function clock(seconds, digits = 3) {
  const at = new Date(1000 * seconds), two = (part) => String(part).padStart(2, "0");
  const whole = `${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}`;
  return digits ? `${whole}.${String(at.getMilliseconds()).padStart(3, "0").slice(0, digits)}` : whole;
}

/** "3 s", "2 min 5 s". */
export function duration(seconds) {
  const whole = Math.floor(seconds);
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}

export function element(name, content = "", attributes = {}) {
  const made = document.createElement(name);
  made.textContent = content;
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  return made;
}
