// The view without a selected robot: causes of trouble, and the missions.

import { counted, duration, element, healthMark, timeOfDay } from "./dom.js";
import { order } from "./answers.js";
import { rehearse } from "./rehearsal.js";
import { label, ordered, select, staleness, store } from "./store.js";

const operates = () => store.permission !== "view";

// Advice by words in a cause; the first match applies.
const NEXT = [
  [/emergency stop|stop input/i, "Look at the robot, then release it on its page."],
  [/quarantin/i, "Give it a worker of its own (worker:), or mend its adapter; restart_adapter ends the quarantine."],
  [/not spoken|nothing received|not been reached|was received|reported nothing/i, "Is it switched on and in reach? Look at its link in fleet.yaml."],
  [/cannot be opened|No such file|gone from|Permission denied/i, "Look at cable, address and rights of the link in fleet.yaml."],
  [/it does not run|has gone|lets us in/i, "Start the edge there: fleet run. The supervisor restarts one that died."],
  [/battery/i, "Charge it, or change its battery policy."],
  [/another edge|twin/i, "Two edges name one twin: take it out of one fleet.yaml."],
  [/fence/i, "Lead it back by hand, or change its fence."],
  [/held|separation|closing/i, "Move the other robot away, or this one in another direction."],
  [/certificate/i, "Make a new one: fleet certs renew."],
  [/disk|read-only|cannot be written/i, "Make room on the disk of the edge, or mend its rights."],
  [/cloud|broker/i, "The robots obey the bus meanwhile; look at network and token of the edge."],
];

function nextStep(cause) {
  return NEXT.find(([pattern]) => pattern.test(cause))?.[1] || "Look at its history, and at what fleet logs prints.";
}

// There is no advice for the past.
const advice = (cause) => (store.past ? "" : element("p", { class: "next" }, nextStep(cause)));

function causeOf(robot) {
  const old = staleness(robot);
  if (old) return old.replace(/ for \d+ s$/, "");
  return robot.health === "ok" ? "" : robot.cause || robot.health;
}

// Robots with the same cause are grouped; figures and the robot's own name do not make it another cause.
function byCause(robots) {
  const found = new Map();
  for (const robot of robots) {
    const cause = causeOf(robot);
    if (!cause) continue;
    const common = cause.replaceAll(robot.name, "ROBOT").replace(/\d+(\.\d+)?/g, "#");
    const key = `${robot.edge} ${common}`;
    found.set(key, [...(found.get(key) || []), robot]);
  }
  return [...found.values()];
}

function robotLink(robot) {
  return element("button", { type: "button", class: "link", onclick: () => select([robot.id]) }, label(robot));
}

function troubleItem(robots) {
  const first = robots[0];
  const oldest = Math.min(...robots.map((robot) => robot.since));
  const many = robots.length > 1 ? `${counted(robots.length, "robot")}: ` : "";
  return element("li", {}, healthMark(staleness(first) ? "offline" : first.health), element("div", {}, element("p", {}, many + causeOf(first)), element("p", { class: "dim" }, store.past ? "" : `since ${duration(Math.max(0, store.time - oldest))} · `, ...robots.slice(0, 12).map(robotLink)), advice(causeOf(first))));
}

function edgeItem(edge) {
  const words = edge.alive ? edge.cause : edge.problem || "away";
  const robots = byCause(ordered().filter((robot) => robot.edge === edge.edge));
  const fine = edge.alive && edge.health === "ok" && !robots.length;
  return element("li", { class: "tree" }, healthMark(edge.alive ? edge.health || "ok" : "offline"), element("div", {}, element("p", {}, element("b", {}, edge.edge), fine ? " all well" : ` ${words || ""}`), words && !robots.length ? advice(words) : "", robots.length ? element("ul", {}, ...robots.map(troubleItem)) : ""));
}

export function health() {
  const edges = Object.values(store.edges);
  if (!edges.length) return [];
  return [element("h3", {}, "Health, by cause"), element("ul", { class: "causes" }, ...edges.map(edgeItem))];
}

// The displayed part of the health; it is redrawn on changes of this, and to update the ages.
export function healthKey() {
  return [Object.values(store.edges).map((edge) => [edge.edge, edge.alive, edge.health, edge.cause, edge.problem]), ordered().map((robot) => [robot.id, causeOf(robot)]), Math.floor(store.time / 10), Boolean(store.past)];
}

// -- missions ------------------------------------------------------------------------------------------------

function control(run, what, more = {}) {
  order({ ask: "run", edge: run.edge, run: run.run, do: what, ...more }, `${run.mission}: ${what}`);
}

function runButton(run, words, what, more) {
  return element("button", { type: "button", disabled: !operates(), onclick: () => control(run, what, more) }, words);
}

function question(run) {
  const asked = run.question;
  if (!asked) return "";
  const answer = (goesOn) => ({ question: asked.id, goes_on: goesOn });
  return element("div", { class: "confirm" }, element("p", {}, asked.text), element("small", {}, `without an answer within ${Math.round(asked.seconds)} s: ${asked.on_timeout}`), store.past ? "" : element("div", { class: "row" }, runButton(run, "Continue", "answer", answer(true)), runButton(run, "Abort", "answer", answer(false))));
}

function lane(robot) {
  const words = robot.within === false ? `left: ${robot.outcome} ${robot.reason || ""}` : robot.doing || robot.outcome || "waits";
  return element("tr", {}, element("th", { scope: "row" }, robot.robot), element("td", { class: "dim" }, robot.role), element("td", {}, words));
}

function runItem(run) {
  const ended = run.phase === "ended";
  const words = ended ? `${run.outcome}${run.reason ? `: ${run.reason}` : ""}` : `step ${run.step}${run.phase === "step" ? "" : ` · ${run.phase}`}`;
  const buttons = ended || store.past ? [] : [run.phase === "paused" ? runButton(run, "Resume", "resume") : runButton(run, "Pause", "pause"), runButton(run, "Abort", "abort")];
  return element("li", { class: `run ${ended ? "ended" : ""}` }, element("p", {}, element("b", {}, run.mission), ` ${words}`), element("p", { class: "dim" }, `run ${run.run}${run.by ? ` by ${run.by}` : ""}, ${timeOfDay(run.started)}`), question(run), ended ? "" : element("table", {}, ...(run.robots || []).map(lane)), buttons.length ? element("div", { class: "row" }, ...buttons) : "");
}

// The inputs of a mission from its form; empty fields are left out.
function inputsOf(form, names) {
  const data = {};
  for (const name of names) {
    const text = form.elements[name].value.trim();
    if (text === "") continue;
    try {
      data[name] = JSON.parse(text);
    } catch {
      data[name] = text;
    }
  }
  return data;
}

function startForm(mission) {
  const inputs = Object.entries(mission.inputs || {});
  const fields = inputs.map(([name, words]) => element("label", {}, element("span", {}, name), element("input", { name, placeholder: words }), ""));
  const given = () => inputsOf(form, Object.keys(mission.inputs || {}));
  const buttons = [
    element("button", { class: "primary", disabled: !operates() }, "Start"),
    element("button", { type: "button", disabled: !operates(), title: "With simulated robots; no robot moves", onclick: () => rehearse(mission, given()) }, "Rehearse"),
  ];
  const form = element("form", { class: "command-form" }, element("p", {}, element("b", {}, mission.name), ` ${mission.summary || ""}`), ...fields, element("div", { class: "row" }, ...buttons));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    order({ ask: "mission", edge: mission.edge, name: mission.name, inputs: given() }, `start ${mission.name}`);
  });
  return form;
}

export function runs() {
  const found = Object.values(store.runs).sort((one, other) => (one.phase === "ended") - (other.phase === "ended") || other.started - one.started);
  if (!found.length) return [];
  return [element("h3", {}, "Runs"), element("ul", { class: "runs" }, ...found.slice(0, 8).map(runItem))];
}

export function missions() {
  const found = Object.values(store.missions);
  if (!found.length) return [];
  return [element("h3", {}, "Missions"), ...found.map(startForm)];
}

// -- schedules -----------------------------------------------------------------------------------------------

function scheduleItem(schedule) {
  const change = (what) => order({ ask: "schedule", edge: schedule.edge, name: schedule.name, do: what }, `schedule ${schedule.name}: ${what}`);
  const button = (words, what) => element("button", { type: "button", disabled: !operates(), onclick: () => change(what) }, words);
  const next = !schedule.enabled ? "switched off" : schedule.next ? `next ${timeOfDay(schedule.next)}` : "waits for its event";
  const last = schedule.last?.[0];
  const past = last ? `last ${timeOfDay(last.due)}: ${last.state || "due"}${last.reason ? `, ${last.reason}` : ""}${last.run ? `, run ${last.run}` : ""}` : "has not fired yet";
  return element(
    "li",
    { class: "run" },
    element("p", {}, element("b", {}, schedule.name), ` ${schedule.mission}, ${schedule.trigger}`),
    element("p", { class: "dim" }, `${next} · ${past}`),
    store.past ? "" : element("div", { class: "row" }, button("Start now", "run"), schedule.enabled ? button("Switch off", "disable") : button("Switch on", "enable")),
  );
}

export function schedules() {
  const found = Object.values(store.schedules);
  if (!found.length) return [];
  return [element("h3", {}, "Schedules"), element("ul", { class: "schedules" }, ...found.map(scheduleItem))];
}
