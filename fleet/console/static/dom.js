// Small helpers: elements without markup (a robot's name is always text), formatted figures.

export function element(tag, given = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(given)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "class") made.className = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "data") Object.assign(made.dataset, value);
    else made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...children.filter((child) => child !== null && child !== undefined && child !== ""));
  return made;
}

export const byId = (id) => document.getElementById(id);

export function counted(number, word) {
  return `${number} ${word}${number === 1 ? "" : "s"}`;
}

export function figure(value, decimals = 1, unit = "") {
  if (value === null || value === undefined) return "–";
  return `${value.toFixed(decimals)}${unit ? `\u202f${unit}` : ""}`;
}

export function duration(seconds) {
  if (seconds < 60) return `${Math.round(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 86400) return `${Math.floor(seconds / 3600)} h`;
  return `${Math.floor(seconds / 86400)} d`;
}

export function timeOfDay(stamp) {
  const at = new Date(stamp * 1000);
  const today = new Date().toDateString() === at.toDateString();
  return today ? at.toLocaleTimeString() : at.toLocaleString();
}

// Replace the children of an element, unless they are equal.
export function show(parent, ...children) {
  parent.replaceChildren(...children.flat().filter(Boolean));
}

const SHAPES = { ok: "●", degraded: "▲", offline: "○", fault: "■" };

export function healthMark(health) {
  const word = SHAPES[health] ? health : "fault";
  return element("span", { class: `mark ${word}`, "aria-hidden": "true" }, SHAPES[word]);
}
