// The list of robots and edges, with their health and the selection.

import { byId, counted, element, figure, healthMark, show } from "./dom.js";
import { label, onChange, ordered, select, staleness, store } from "./store.js";

function remark(robot) {
  const old = staleness(robot);
  if (old) return old;
  if (robot.emergency_stop) return `stopped: ${robot.stop_cause || "cause unknown"}`;
  return robot.cause || robot.activity || (robot.reachable ? "idle" : "not reachable");
}

function choose(event, id) {
  held = false;
  select([id], { add: event.shiftKey || event.ctrlKey || event.metaKey });
}

function move(event, id) {
  const ids = ordered().map((robot) => robot.id);
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (step) {
    event.preventDefault();
    const next = ids[Math.min(ids.length - 1, Math.max(0, ids.indexOf(id) + step))];
    select([next], { add: event.shiftKey && !store.selected.has(next) });
    byId("robots").querySelector(`[data-id="${CSS.escape(next)}"]`)?.focus();
  } else if (event.key === "Enter" || event.key === " ") {
    event.preventDefault();
    choose(event, id);
  } else if (event.key === "a" && (event.ctrlKey || event.metaKey)) {
    event.preventDefault();
    select(ids);
  }
}

function row(robot) {
  const chosen = store.selected.has(robot.id);
  const old = staleness(robot);
  const tags = [];
  if (robot.simulated) tags.push(element("span", { class: "tag sim" }, "SIM"));
  if (robot.emergency_stop) tags.push(element("span", { class: "tag halt" }, "STOPPED"));
  if (robot.run) tags.push(element("span", { class: "tag" }, "RUN"));
  return element(
    "li",
    {
      role: "option",
      tabindex: "0",
      "aria-selected": String(chosen),
      class: `${chosen ? "chosen" : ""} ${old ? "old" : ""}`,
      data: { id: robot.id },
      onclick: (event) => choose(event, robot.id),
      onkeydown: (event) => move(event, robot.id),
    },
    healthMark(old ? "offline" : robot.health),
    element("span", { class: "name" }, label(robot), ...tags),
    element("span", { class: "battery" }, robot.battery === null ? "" : figure(robot.battery, 0, "%")),
    element("span", { class: "words" }, `${old ? "unknown" : robot.health} · ${remark(robot)}`),
  );
}

function edgeLine(edge) {
  const health = edge.alive ? edge.health || "ok" : "offline";
  const words = edge.alive ? edge.cause || `cloud ${edge.cloud ?? "unknown"}` : edge.problem || "away";
  return element("div", { class: "edge" }, healthMark(health), element("span", { class: "name" }, edge.edge), element("span", { class: "words" }, words));
}

let drawn = "";
let held = false; // pointer pressed on the list: a row must not be replaced before its click
function draw() {
  if (held) return;
  const robots = ordered();
  const edges = Object.values(store.edges);
  // Only visible values count: stamps alone change each second.
  const seen = robots.map((robot) => [robot.id, robot.health, remark(robot), robot.battery && Math.round(robot.battery), robot.run, robot.simulated, store.selected.has(robot.id)]);
  const key = JSON.stringify([seen, edges.map((edge) => [edge.edge, edge.alive, edge.health, edge.cause, edge.cloud, edge.problem])]);
  if (key === drawn) return;
  drawn = key;
  const focused = document.activeElement?.dataset?.id;
  show(byId("robots"), robots.map(row));
  show(byId("edges"), edges.map(edgeLine));
  if (focused) byId("robots").querySelector(`[data-id="${CSS.escape(focused)}"]`)?.focus();
  byId("empty").hidden = robots.length > 0;
  byId("empty").textContent = edges.length
    ? "No robot has reported yet."
    : "No edge runs on this computer. The page shows one as soon as it starts: fleet run, or fleet demo.";
  const simulated = robots.filter((robot) => robot.simulated).length;
  const words = robots.length ? [counted(robots.length, "robot")] : [];
  if (simulated) words.push(simulated === robots.length ? "all simulated" : `${simulated} simulated`);
  byId("fleet-words").textContent = words.join(", ");
}

export function startRobots() {
  byId("robots").addEventListener("pointerdown", () => (held = true));
  for (const end of ["pointerup", "pointercancel"]) {
    addEventListener(end, () => {
      held = false;
      setTimeout(draw); // after the click that follows
    });
  }
  onChange((kinds) => {
    if (["robots", "edges", "selection", "hello"].some((kind) => kinds.has(kind))) draw();
  });
  setInterval(draw, 1000);
}
