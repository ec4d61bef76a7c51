// The selected robot: its activity and faults, its figures, its commands, and its release.

import { byId, counted, duration, element, figure, healthMark, show, timeOfDay } from "./dom.js";
import { order } from "./answers.js";
import { configurationKey, configurations, startConfigurations } from "./configuration.js";
import { bodyKey, bodyOf, startBody } from "./body.js";
import { askButton, holder, isAnothers } from "./control.js";
import { health, healthKey, missions, runs, schedules } from "./overview.js";
import { movePad, noPad, padOf } from "./pad.js";
import { photoKey, photoOf } from "./photo.js";
import { endVideo, videoKey, videoOf } from "./video.js";
import { plots, plotsKey, startPlots } from "./plots.js";
import { rehearsalKey, rehearsed, startRehearsal } from "./rehearsal.js";
import { fit, map, view } from "./mapview.js";
import { ask, label, onChange, send, staleness, store } from "./store.js";
import { stoppedRobots } from "./stopview.js";

const HOLDING = new Set(["stop", "hover", "brake"]);
const HIDDEN = new Set(["release_emergency_stop", "emergency_stop", "join_run", "leave_run"]);
const operates = () => store.permission !== "view";
let causes = {};
let releasing = false;
let opened = ""; // the command whose form is open

function fact(word, value, extra = "") {
  return [element("dt", {}, word), element("dd", { title: value }, value, extra ? element("small", {}, ` ${extra}`) : "")];
}

function position(robot) {
  const pose = store.poses[robot.id];
  if (!pose) return "–";
  return pose.slice(0, 3).map((value) => value.toFixed(2)).join("  ");
}

// One line each, and always as many: the commands below must not move under the pointer.
function facts(robot) {
  const yaw = store.poses[robot.id]?.[3];
  const armed = { true: "armed", false: "disarmed" }[robot.armed] || "";
  return element(
    "dl",
    { class: "facts" },
    ...fact("Doing", robot.activity || "nothing"),
    ...fact("Mode", robot.mode || "–", armed),
    ...fact("Battery", robot.battery === null ? "–" : figure(robot.battery, 0, "%")),
    ...fact("Speed", figure(robot.speed, 2, "m/s")),
    ...fact(robot.site ? "Position" : "Own frame", position(robot), "m"),
    ...fact("Heading", yaw === undefined || yaw === null ? "–" : `${Math.round((yaw * 180) / Math.PI)}°`, "from east"),
    ...fact("Control", holder(robot)),
    ...fact("Link", robot.reachable ? "reachable" : "not reachable", robot.age === null ? "never heard" : `heard ${duration(robot.age)} ago`),
    ...fact("Last command", robot.last_command ? `${robot.last_command}: ${robot.last_outcome}` : "–"),
    ...fact("Separation", robot.separation || "–"),
    ...fact("In run", robot.run || "–"),
  );
}

function trouble(robot) {
  const found = [];
  const old = staleness(robot);
  if (old) found.push(`Unknown: ${old}.`);
  if (robot.cause) found.push(robot.cause);
  return found.map((text) => element("p", { class: `cause ${robot.health}` }, text));
}

function field(parameter) {
  const bounds = [];
  if (parameter.least !== undefined) bounds.push(`from ${parameter.least}`);
  if (parameter.most !== undefined) bounds.push(`to ${parameter.most}`);
  const numeric = parameter.type === "number" || parameter.type === "whole number";
  const input = element("input", {
    name: parameter.name,
    type: numeric ? "number" : "text",
    step: parameter.type === "number" ? "any" : undefined,
    min: parameter.least,
    max: parameter.most,
    required: parameter.required,
    placeholder: parameter.default || (parameter.required ? "" : "left out"),
  });
  const told = [parameter.unit, ...bounds].filter(Boolean).join(" ");
  return element("label", {}, element("span", {}, parameter.name), input, element("small", {}, told || parameter.type));
}

// The data of a command from its form; empty fields are left out.
function dataOf(form, command) {
  const data = {};
  for (const parameter of command.parameters || []) {
    const text = form.elements[parameter.name].value.trim();
    if (text === "") continue;
    try {
      data[parameter.name] = parameter.type === "text" ? text : JSON.parse(text);
    } catch {
      data[parameter.name] = text;
    }
  }
  return data;
}

function sendCommand(robot, command, data) {
  const told = Object.entries(data).map(([name, value]) => `${name}=${value}`);
  order({ ask: "command", robot: robot.id, command: command.name, data }, [label(robot), command.name, ...told].join(" "));
  opened = "";
  draw();
}

function commandForm(robot, command) {
  const form = element("form", { class: "command-form" }, ...(command.parameters || []).map(field));
  form.append(element("div", { class: "row" }, element("button", { class: "primary" }, `Send ${command.name}`), element("button", { type: "button", class: "plain", onclick: () => { opened = ""; draw(); } }, "Cancel")));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    sendCommand(robot, command, dataOf(form, command));
  });
  return form;
}

function commandButton(robot, command) {
  const why = !operates() ? "it needs the permission operate" : command.refusal || "";
  const plain = !(command.parameters || []).length;
  return element(
    "button",
    {
      type: "button",
      class: "command",
      "aria-disabled": why ? "true" : undefined,
      title: why ? `Not now: ${why}` : command.summary,
      onclick: () => {
        if (why) return;
        if (plain) sendCommand(robot, command, {});
        else {
          opened = command.name;
          draw();
        }
      },
    },
    command.name.replaceAll("_", " "),
    plain ? "" : "…",
  );
}

// Buttons of commands under a heading, and the form of one that was opened.
function commandGroup(robot, heading, list) {
  if (!list.length) return null;
  const form = list.find((command) => command.name === opened);
  return element(
    "div",
    {},
    element("h3", {}, heading),
    element("div", { class: "commands" }, ...list.map((command) => commandButton(robot, command))),
    form ? commandForm(robot, form) : "",
  );
}

function holdCommands(robot) {
  return [commandGroup(robot, "Hold", store.descriptions[robot.id].commands.filter((command) => HOLDING.has(command.name)))];
}

// All other commands: those that move the robot, and those that do not.
function commands(robot) {
  const told = store.descriptions[robot.id];
  if (!told) return [element("p", { class: "dim" }, "Its commands are not known yet.")];
  const shown = told.commands.filter((command) => !HIDDEN.has(command.name) && !HOLDING.has(command.name) && (robot.run || command.name !== "take"));
  return [
    commandGroup(robot, "Motion", shown.filter((command) => command.moves)),
    commandGroup(robot, "Other commands", shown.filter((command) => !command.moves)),
  ];
}

// Limitations of the robot: missing vocabulary, and commands that it would refuse now, with the reasons.
function cannot(robot, told) {
  const never = [];
  if (!told.goals) never.push("go to a place on the map");
  if (!told.drives) never.push("be driven by hand");
  const found = never.length ? [["Never", never.join(", "), "this kind of robot has no command for it"]] : [];
  const refusals = new Map();
  const shown = told.commands.filter((command) => !HIDDEN.has(command.name) && command.name !== "take");
  for (const command of shown.filter((each) => each.refusal)) refusals.set(command.refusal, [...(refusals.get(command.refusal) || []), command.name]);
  for (const [why, names] of refusals) {
    const words = names.length === shown.length ? "any command" : names.map((name) => name.replaceAll("_", " ")).join(", ");
    found.push(["Not now", words, why]);
  }
  if (told.goals_refusal) found.push(["Not now", "go to a place on the map", told.goals_refusal]);
  if (!operates()) found.push(["Not you", "anything but a stop", "it needs the permission operate; yours is view"]);
  if (!found.length) return [];
  const items = found.map(([when, what, why]) => element("li", {}, element("b", {}, when), element("span", {}, what), element("small", {}, why)));
  return [element("h3", {}, "What it cannot do"), element("ul", { class: "cannot" }, ...items)];
}

function eventItem(event) {
  const whose = event.robot && store.past && !store.selected.size ? `${event.robot}: ` : "";
  return element("li", {}, element("time", {}, timeOfDay(event.at)), element("p", {}, whose + event.text, event.by ? element("small", {}, ` ${event.by}${event.proven ? "" : " (claimed)"}`) : ""));
}

// Events before a moment of the past: of the selected robots, or of all.
function events(chosen) {
  const found = store.past.events.filter((event) => !chosen.length || chosen.some((robot) => robot.id === event.robot));
  const none = found.length ? "" : element("p", { class: "dim" }, "No event was recorded shortly before.");
  return [element("h3", {}, "History until then"), none, element("ul", { class: "history" }, ...found.slice(0, 30).map(eventItem))];
}

// The recent requests to the robot, with senders and outcomes; loaded on demand.
let past = { robot: "", events: null };
function history(robot) {
  const look = () => {
    ask({ ask: "history", robot: robot.id }, (answer) => {
      past = { robot: robot.id, events: answer.history || [] };
      draw();
    });
  };
  const known = past.robot === robot.id ? past.events : null;
  const items = (known || []).map(eventItem);
  const none = known && !known.length ? element("p", { class: "dim" }, "Nothing is known.") : "";
  return [element("h3", {}, "History"), element("button", { type: "button", onclick: look }, known ? "Look again" : "Show"), none, element("ul", { class: "history" }, ...items)];
}

function release(robots) {
  const names = robots.length === 1 ? label(robots[0]) : counted(robots.length, "robot");
  if (!releasing) {
    const begin = () => {
      releasing = true;
      causes = {};
      ask({ ask: "causes", robots: robots.map((robot) => robot.id) }, (answer) => {
        causes = answer.causes || {};
        draw();
      });
      draw();
    };
    return [element("button", { type: "button", class: "release", disabled: !operates(), onclick: begin }, `Release ${names}…`)];
  }
  const items = robots.map((robot) => {
    const cause = causes[robot.id];
    const who = cause ? `${cause.by || "unknown sender"}, ${timeOfDay(cause.at)}: ${cause.why}` : robot.stop_cause || "cause unknown";
    return element("li", {}, element("b", {}, label(robot)), ` stopped by ${who}`);
  });
  const go = () => {
    order({ ask: "release", robots: robots.map((robot) => robot.id) }, `release ${names}`);
    releasing = false;
    draw();
  };
  const stay = () => {
    releasing = false;
    draw();
  };
  return [
    element(
      "div",
      { class: "confirm", role: "group", "aria-label": "Release" },
      element("ul", {}, ...items),
      element("p", {}, "Nothing moves by the release. They stay where they are until somebody asks for more."),
      element("div", { class: "row" }, element("button", { type: "button", class: "release", onclick: go }, `Release ${names}`), element("button", { type: "button", class: "plain", onclick: stay }, "Keep stopped")),
    ),
  ];
}

// The name and the faults of a robot, always of the same height: the pad below must not move under the pointer.
function title(robot) {
  const tags = [robot.simulated ? element("span", { class: "tag sim" }, "SIMULATED") : "", robot.emergency_stop ? element("span", { class: "tag halt" }, "STOPPED") : ""];
  const about = `${robot.adapter} on edge ${robot.edge} · ${robot.health}`;
  return [
    element("div", { class: "head" }, healthMark(staleness(robot) ? "offline" : robot.health), element("h2", {}, label(robot)), ...tags),
    element("p", { class: "dim about", title: about }, about),
    element("div", { class: "troubles", tabindex: "0", role: "group", "aria-label": "Faults" }, ...trouble(robot)),
  ];
}

function titleOfSeveral(robots) {
  const names = robots.map((robot) => element("li", {}, healthMark(robot.health), ` ${label(robot)}`));
  return [
    element("div", { class: "head" }, element("h2", {}, `${robots.length} robots`)),
    element("p", { class: "dim" }, store.past ? "As they were." : "Click on the map to send them there, spread apart."),
    element("ul", { class: "plain-list" }, ...names),
  ];
}

function titleOfNobody() {
  return [
    element("div", { class: "head" }, element("h2", {}, "No robot selected")),
    element("p", { class: "dim" }, store.past ? "Choose one in the list or on the map." : "Choose one in the list or on the map. Drag a box to choose several, then click where they shall go."),
  ];
}

// The parts of the panel, each redrawn only when its content has changed: a button must not be replaced
// between the press and the release of the pointer.
const parts = {};
function part(name, key, make) {
  const place = (parts[name] ??= byId("robot").appendChild(element("div", { class: `part ${name}` })));
  const text = JSON.stringify(key);
  if (place.dataset.key === text || (held && name !== "figures")) return;
  place.dataset.key = text;
  const focused = place.contains(document.activeElement) ? document.activeElement.textContent : "";
  show(place, make());
  if (focused) [...place.querySelectorAll("button")].find((button) => button.textContent === focused)?.focus();
}

let held = false; // the pointer is down on the panel

// What the operator presses comes first, below parts of a fixed height: what appears later is below it.
function draw() {
  const chosen = [...store.selected].map((id) => store.robots[id]).filter(Boolean);
  const robot = chosen.length === 1 ? chosen[0] : null;
  const stopped = chosen.length ? chosen.filter((each) => each.emergency_stop) : stoppedRobots();
  const described = robot && store.descriptions[robot.id];
  const names = chosen.map((each) => [each.id, each.health, each.cause, each.emergency_stop, staleness(each)]);
  const make = robot ? () => title(robot) : chosen.length ? () => titleOfSeveral(chosen) : titleOfNobody;
  part("title", [names, Boolean(store.past)], make);
  const now = !store.past;
  part("stopped", now && [stopped.map((each) => [each.id, each.stop_cause]), releasing, causes, store.permission], () => (now && stopped.length ? release(stopped) : []));
  const alone = !chosen.length;
  part("health", alone && healthKey(), () => (alone ? health() : []));
  part("runs", alone && [store.runs, store.permission, now], () => (alone ? runs() : []));
  part("rehearsed", alone && now && rehearsalKey(), () => (alone && now ? rehearsed() : []));
  part("missions", alone && [store.missions, store.permission], () => (alone ? missions() : []));
  const drives = robot && described?.drives && operates() ? described : null;
  part("driving", drives && [robot.id, drives.limits], () => (drives ? [element("h3", {}, "Drive by hand"), padOf(robot, drives)] : noPad() || []));
  movePad(parts.driving.offsetTop);
  const holds = robot && now && described;
  part("holding", holds && [robot.id, opened || described, store.permission], () => (holds ? holdCommands(robot) : []));
  part("figures", robot && [robot, position(robot), store.poses[robot.id]], () => (robot ? [facts(robot)] : []));
  // While a form is open, updates must not replace the typed text.
  part("asking", robot && now && [robot.id, opened || described, robot.run, store.permission], () => (robot && now ? commands(robot) : []));
  const others = robot && now && operates() && isAnothers(robot);
  part("control", others && [robot.id, robot.control], () => (others ? [askButton(robot)] : []));
  part("cannot", robot && described && [robot.id, described, store.permission], () => (robot && described ? cannot(robot, described) : []));
  part("schedules", alone && [store.schedules, store.permission, now], () => (alone ? schedules() : []));
  part("configuration", alone && now && configurationKey(), () => (alone && now ? configurations() : []));
  const drawn = robot && described?.body?.length;
  part("body", drawn && bodyKey(robot), () => (drawn ? bodyOf(robot) : []));
  const seen = robot && now && store.photos[robot.id];
  part("photo", seen && photoKey(robot), () => (seen ? photoOf(robot) : []));
  const films = robot && now && operates() && described?.commands.some((command) => command.name === "start_video");
  part("video", films && videoKey(robot), () => (films ? videoOf(robot) : []));
  part("plots", robot && [robot.id, plotsKey()], () => (robot ? plots() : []));
  part("history", robot && now && [robot.id, past], () => (robot && now ? history(robot) : []));
  part("events", !now && [store.past.events, chosen.map((each) => each.id)], () => (now ? [] : events(chosen)));
}

export function startPanel() {
  let watched = null;
  const watch = () => {
    const wanted = [...store.selected][0] || "";
    if (wanted !== watched && send({ ask: "watch", robot: wanted })) watched = wanted;
  };
  onChange((kinds) => {
    if (kinds.has("open")) watched = null;
    if (kinds.has("selection") || kinds.has("past")) {
      window.fleetPage.endPads();
      endVideo();
      releasing = false;
      opened = "";
    }
    watch();
    draw();
  });
  startPlots(draw);
  startBody();
  startConfigurations(draw);
  startRehearsal(draw, () => (map.dirty = true), () => view.touched || fit());
  const pane = byId("robot");
  pane.addEventListener("pointerdown", () => (held = true));
  for (const end of ["pointerup", "pointercancel"]) {
    addEventListener(end, () => {
      held = false;
      setTimeout(draw); // after the click that follows
    });
  }
  draw();
}
