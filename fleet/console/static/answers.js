// The requests of this page with their answers, newest first.

import { byId, element } from "./dom.js";
import { ask, label, onChange, store } from "./store.js";

const MOST = 50;

function words(answer) {
  if (answer.done) return ["done", "good"];
  if (answer.done === false) return [`not done: ${answer.reason}`, "bad"];
  if (answer.status === "accepted") return ["accepted, under way", "asking"];
  return [`${answer.status}: ${answer.reason}${answer.hint ? ` (${answer.hint})` : ""}`, "bad"];
}

function line(what) {
  const state = element("span", { class: "asking" }, "asking…");
  const made = element("li", {}, element("time", {}, new Date().toLocaleTimeString()), element("span", { class: "what" }, what), state);
  const list = byId("answers");
  list.prepend(made);
  while (list.children.length > MOST) list.lastChild.remove();
  return state;
}

function tell(state, text, kind) {
  state.textContent = text;
  state.className = kind;
}

// Send a request to robots; one line shows it, with each robot's answer.
export function order(message, what, call = () => {}) {
  const state = line(what);
  const told = new Map();
  const out = ask(message, (answer) => {
    const name = answer.robot && store.robots[answer.robot] ? label(store.robots[answer.robot]) : answer.robot;
    const [text, kind] = words(answer);
    told.set(name, [text, kind]);
    const kinds = [...told.values()].map((each) => each[1]);
    const all = [...told].map(([robot, [said]]) => (robot && told.size > 1 ? `${robot}: ${said}` : said));
    tell(state, [...new Set(all)].join("; "), kinds.includes("bad") ? "bad" : kinds.includes("asking") ? "asking" : "good");
    call(answer);
  });
  if (!out) tell(state, "NOT SENT: there is no connection to the console", "bad");
}

export function startAnswers() {
  onChange((kinds, message) => {
    if (kinds.has("answers") && message) tell(line("the console"), message.reason, "bad");
  });
}
