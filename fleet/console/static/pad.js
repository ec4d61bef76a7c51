// The pad: a robot moves only while a button or key is held. It sends ten velocities per second, and one zero
// at the end. It ends at release, when the page loses the focus or is hidden, when the connection closes,
// when a round trip takes longer than LATE, and at Esc. A pad that ended for a fault must be pressed again. A
// gamepad moves the robot only while a shoulder button is held, and only after its sticks were seen centred. A
// pad that has moved on the page must be pressed again, since the pointer may have been on something else.

import { element } from "./dom.js";
import { onClose, onDrove, send, silentFor } from "./store.js";

const EVERY = 100; // ms
const LATE = 300; // ms of a round trip to the robot's edge
const SHARE = 0.5; // initial share of the robot's limits
const USUAL = { speed: 0.5, yaw_rate: 0.8, vertical_speed: 0.5 }; // for a robot without a reported limit
const AXES = {
  forward: ["w", "Forward", "▲", { linear_x: 1 }],
  back: ["s", "Back", "▼", { linear_x: -1 }],
  left: ["a", "Turn left", "↺", { angular_z: 1 }],
  right: ["d", "Turn right", "↻", { angular_z: -1 }],
  sideways_left: ["q", "Sideways left", "◀", { linear_y: 1 }],
  sideways_right: ["e", "Sideways right", "▶", { linear_y: -1 }],
  up: ["r", "Up", "⤒", { linear_z: 1 }],
  down: ["f", "Down", "⤓", { linear_z: -1 }],
};
const IDLE = "Hold a button, W A S D, or a shoulder button of a gamepad and push its sticks.";
const GAMEPAD = "gamepad"; // stands in ``held`` beside the axes
const SHOULDERS = [4, 5, 6, 7]; // buttons of the standard gamepad: both shoulders, both triggers
const DEAD = 0.15; // dead zone, as a share of a stick's range
const SETTLED = 500; // ms after the pad has moved on the page: a press until then was meant for something else
const LOOK = 50; // ms between polls of the gamepad, which sends no events
const held = new Set();
let sticks = {}; // share of the limit, by axis
let ready = false; // true after all shoulder buttons were seen released since the pad ended
let looking = 0;
const open = new Map(); // time of sending, by number
let pad = null; // {robot, limits, share, words}
let timer = 0;
let number = 0;
let padTop = null; // its place on the page, px
let movedAt = -Infinity;

function velocity() {
  const limits = { ...USUAL, ...pad.limits };
  const most = { linear_x: limits.speed, linear_y: limits.speed, linear_z: limits.vertical_speed, angular_z: limits.yaw_rate };
  const sum = {};
  for (const name of held) for (const [axis, share] of Object.entries(name === GAMEPAD ? sticks : AXES[name][3])) sum[axis] = (sum[axis] || 0) + share;
  for (const axis of Object.keys(sum)) sum[axis] = Math.max(-1, Math.min(1, sum[axis])) * most[axis] * pad.share;
  return sum;
}

function say(words, kind = "") {
  if (!pad) return;
  pad.words.textContent = words;
  pad.words.className = kind;
}

function turn() {
  const now = performance.now();
  for (const sent of open.values()) if (now - sent > LATE) return end(`Ended: no answer within ${LATE} ms. Press again.`, "bad");
  if (silentFor() > 1000) return end("Ended: the console is silent. Press again.", "bad");
  number += 1;
  open.set(number, now);
  if (!send({ ask: "drive", number, robot: pad.robot, ...velocity() })) end("Ended: there is no connection.", "bad");
}

function begin(name) {
  if (!pad || held.has(name)) return;
  held.add(name);
  if (!timer) {
    open.clear();
    timer = setInterval(turn, EVERY);
  }
  turn();
}

function release(name) {
  if (!held.delete(name)) return;
  if (held.size) turn();
  else end(IDLE);
}

export function end(words = "", kind = "") {
  if (!timer) return;
  clearInterval(timer);
  timer = 0;
  ready = false;
  held.clear();
  open.clear();
  if (pad) send({ ask: "drive", number: 0, robot: pad.robot });
  say(words, kind);
}

// -- gamepad -----------------------------------------------------------------------------------------------

// Left stick: forward and turn. Right stick: sideways, and up for a robot that flies.
function sticksOf(gamepad) {
  const value = (index) => {
    const pushed = gamepad.axes[index] || 0;
    return Math.abs(pushed) < DEAD ? 0 : (-Math.sign(pushed) * (Math.abs(pushed) - DEAD)) / (1 - DEAD);
  };
  const found = { linear_x: value(1), angular_z: value(0), linear_y: value(2), linear_z: pad.limits.vertical_speed === undefined ? 0 : value(3) };
  return Object.fromEntries(Object.entries(found).filter(([, share]) => share));
}

function look() {
  const gamepad = [...navigator.getGamepads()].find((each) => each?.connected);
  const holds = Boolean(gamepad && SHOULDERS.some((index) => gamepad.buttons[index]?.pressed));
  if (!holds) {
    ready = true;
    return release(GAMEPAD);
  }
  sticks = pad ? sticksOf(gamepad) : {};
  if (!pad || !ready || held.has(GAMEPAD) || !document.hasFocus()) return;
  if (Object.keys(sticks).length) say("Let go of the sticks of the gamepad, then push them.");
  else begin(GAMEPAD);
}

function button(name) {
  const [key, title, sign] = AXES[name];
  const made = element("button", { type: "button", class: `axis ${name}`, title: `${title} (${key.toUpperCase()})`, "aria-label": title, "aria-keyshortcuts": key.toUpperCase() }, sign);
  made.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    if (performance.now() - movedAt < SETTLED) return say("The pad has moved. Press again.", "bad");
    made.setPointerCapture(event.pointerId);
    begin(name);
  });
  for (const over of ["pointerup", "pointercancel", "lostpointercapture"]) made.addEventListener(over, () => release(name));
  made.addEventListener("contextmenu", (event) => event.preventDefault());
  return made;
}

// The pad of a robot that accepts velocities; ``told`` is its description.
export function padOf(robot, told) {
  end("");
  const flies = told.limits?.vertical_speed !== undefined;
  const names = Object.keys(AXES).filter((name) => flies || !["up", "down"].includes(name));
  const words = element("p", { role: "status" }, IDLE);
  const speed = element("input", { type: "range", min: "0.1", max: "1", step: "0.1", value: String(SHARE), "aria-label": "Share of the speed limit" });
  pad = { robot: robot.id, limits: told.limits || {}, share: SHARE, words };
  speed.addEventListener("input", () => (pad.share = Number(speed.value)));
  return element("div", { class: "pad", tabindex: "0", role: "group", "aria-label": "Drive by hand", onkeydown: pressed }, element("div", { class: `axes ${flies ? "flies" : ""}` }, ...names.map(button)), element("label", {}, element("small", {}, "speed"), speed), words);
}

// Record where the pad is; a press right after it has moved does nothing.
export function movePad(place) {
  if (pad && padTop !== null && place !== padTop) movedAt = performance.now();
  padTop = pad ? place : null;
}

export function noPad() {
  end("");
  pad = null;
}

const nameOf = (event) => Object.keys(AXES).find((name) => AXES[name][0] === event.key.toLowerCase());

function pressed(event) {
  const name = nameOf(event);
  if (!name || event.repeat || event.ctrlKey || event.metaKey || event.altKey || event.target.type === "range") return;
  event.preventDefault();
  begin(name);
}

export function startPad() {
  window.fleetPage.endPads = () => end("Ended by Esc or a stop.", "");
  addEventListener("keyup", (event) => {
    const name = nameOf(event);
    if (name) release(name);
  });
  addEventListener("gamepadconnected", () => (looking ||= setInterval(look, LOOK)));
  addEventListener("blur", () => end("Ended: the page lost the focus.", ""));
  document.addEventListener("visibilitychange", () => document.hidden && end("Ended: the page was hidden.", ""));
  addEventListener("pagehide", () => end(""));
  onClose(() => end("Ended: the connection closed. Press again.", "bad"));
  onDrove((message) => {
    const sent = open.get(message.number);
    open.delete(message.number);
    if (!timer || sent === undefined) return;
    if (message.status !== "accepted") end(`${message.status}: ${message.reason}`, "bad");
    else say(`Driving; ${Math.max(1, Math.round(performance.now() - sent))} ms there and back.`, "good");
  });
}
