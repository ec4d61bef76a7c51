// The fleet.yaml of each edge, with its errors and the changes that the edge does not use yet.

import { element } from "./dom.js";
import { ask, store } from "./store.js";

const told = {}; // answers by edge; null while a request is pending
let redraw = () => {};

function look(edge) {
  told[edge] = null;
  const out = ask({ ask: "config", edge }, (answer) => {
    told[edge] = answer.config || { problems: [answer.reason], warnings: [], changes: [], text: "", file: "" };
    redraw();
  });
  if (!out) delete told[edge];
  redraw();
}

const list = (words, kind) => words.map((text) => element("p", { class: `cause ${kind}` }, text));

function shown(edge) {
  const found = told[edge];
  if (found === null) return [element("p", { class: "dim" }, "It reads its file…")];
  if (!found) return [];
  const fine = !found.problems.length && !found.warnings.length;
  const changes = found.changes.length ? [element("p", {}, "Not in use yet; fleet apply takes it over:"), element("ul", { class: "changes" }, ...found.changes.map((text) => element("li", {}, text)))] : [];
  return [
    element("p", { class: "dim" }, found.file),
    ...list(found.problems, "fault"),
    ...list(found.warnings, "degraded"),
    fine ? element("p", {}, "Nothing is wrong with it.") : "",
    ...changes,
    found.text ? element("pre", { class: "file", tabindex: "0", "aria-label": `fleet.yaml of ${edge}` }, found.text) : "",
  ];
}

export const configurationKey = () => [Object.keys(store.edges), told, store.permission];

export function configurations() {
  const edges = Object.values(store.edges).filter((edge) => edge.alive);
  if (!edges.length || store.permission !== "admin") return [];
  const parts = edges.map((edge) => element("div", {}, element("button", { type: "button", onclick: () => look(edge.edge) }, `${told[edge.edge] ? "Read again:" : "Show"} fleet.yaml of ${edge.edge}`), ...shown(edge.edge)));
  return [element("h3", {}, "Configuration"), ...parts];
}

export function startConfigurations(call) {
  redraw = call;
}
