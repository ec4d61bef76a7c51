// Control of a robot, and requests for it: the page of the holder shows a request above everything else.

import { byId, element, show } from "./dom.js";
import { order } from "./answers.js";
import { label, onChange, store } from "./store.js";

const SHOWN = 30; // s

function open() {
  return Object.entries(store.requests).filter(([id, told]) => store.robots[id] && store.time - told.at < SHOWN);
}

function asked([id, told]) {
  const name = label(store.robots[id]);
  if (told.holder === store.operator && !told.answer) {
    const answer = (give) => order({ ask: "give", robot: id, give }, give ? `give ${name} to ${told.by}` : `keep ${name}`);
    return element(
      "div",
      { class: "confirm" },
      element("p", {}, element("b", {}, told.by), ` asks for control of ${name}. To give it stops the robot.`),
      element("div", { class: "row" }, element("button", { type: "button", class: "primary", onclick: () => answer(true) }, `Give ${name}`), element("button", { type: "button", onclick: () => answer(false) }, "Keep it")),
    );
  }
  if (told.by !== store.operator) return null;
  const words = { "": `${told.holder} is asked for ${name}…`, given: `${told.holder} gave ${name}: it can be commanded.`, kept: `${told.holder} keeps ${name}.` };
  return element("div", { class: "confirm" }, element("p", {}, words[told.answer]));
}

let drawn = "";
function draw() {
  const found = open();
  const key = JSON.stringify([found, store.operator]);
  if (key === drawn) return;
  drawn = key;
  show(byId("asks"), found.map(asked));
}

// The holder of a robot, for its panel.
export function holder(robot) {
  if (robot.run) return `run ${robot.run}`;
  if (!robot.control) return "none";
  return robot.control === store.operator ? "you" : robot.control;
}

export const isAnothers = (robot) => Boolean(robot.control) && !robot.run && robot.control !== store.operator;

export function askButton(robot) {
  const ask = () => order({ ask: "control", robot: robot.id }, `ask ${robot.control} for ${label(robot)}`);
  return element("button", { type: "button", class: "ask-control", onclick: ask }, `Ask ${robot.control} for control`);
}

export function startControl() {
  onChange(draw);
  setInterval(draw, 1000);
}
