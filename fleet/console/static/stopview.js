// The result of the last stop: which robots confirmed it after how many milliseconds, and were seen to stand.

import { byId, counted, element, show } from "./dom.js";
import { label, live, onChange, ordered, silentFor, SILENT, store } from "./store.js";

const page = window.fleetPage;
let remark = "";

function newest() {
  const own = [...page.stops.entries()].pop();
  if (own) return { own: own[1], told: own[1].told };
  const told = Object.values(store.stops).pop();
  return told ? { own: null, told } : null;
}

function summary({ own, told }) {
  if (!told) {
    const waited = Math.round(performance.now() - own.began);
    const trouble = own.error ? ` ${own.error}.` : "";
    return own.tries
      ? [`NOT ANSWERED after ${waited} ms, ${counted(own.tries, "try").replace("trys", "tries")}.${trouble} Use another stop: fleet stop --all, or the robot's own.`, "bad"]
      : [`Asking for the stop… ${waited} ms`, "asking"];
  }
  const robots = Object.values(told.robots);
  if (!robots.length) return ["The stop was taken, but no robot was reached.", "bad"];
  const set = robots.filter((robot) => robot.acknowledged !== null);
  const standing = robots.filter((robot) => robot.standing !== null);
  const slowest = (list, key) => Math.max(...list.map((robot) => robot[key]));
  const words = [`${set.length} of ${robots.length} stops set` + (set.length ? ` within ${slowest(set, "acknowledged")} ms` : "")];
  words.push(`${standing.length} seen standing` + (standing.length ? ` within ${slowest(standing, "standing")} ms` : ""));
  if (told.open) return [words.join(", "), "asking"];
  const bad = robots.length - standing.length;
  return [words.join(", ") + (bad ? `: ${bad} NOT SEEN TO STOP` : ""), bad ? "bad" : "good"];
}

function rows(told) {
  return Object.entries(told.robots).map(([id, robot]) => {
    const name = store.robots[id] ? label(store.robots[id]) : id;
    const failed = !told.open && robot.standing === null;
    return element(
      "tr",
      { class: failed ? "bad" : "" },
      element("th", { scope: "row" }, name),
      element("td", {}, robot.acknowledged === null ? "–" : `${robot.acknowledged} ms`),
      element("td", {}, robot.standing === null ? "–" : `${robot.standing} ms`),
      element("td", {}, robot.outcome === "done" ? "stands" : robot.outcome),
      element("td", {}, robot.way),
    );
  });
}

function detail(told) {
  const head = ["Robot", "Stop set", "Seen standing", "Now", "By way of"];
  const table = element(
    "table",
    {},
    element("thead", {}, element("tr", {}, ...head.map((word) => element("th", { scope: "col" }, word)))),
    element("tbody", {}, ...rows(told)),
  );
  const problems = told.problems.map((problem) => element("p", { class: "bad" }, problem));
  return [element("h2", {}, `Stop asked by ${told.by || "unknown sender"}`), table, ...problems];
}

const KEPT = 4000; // ms that the table stays open after every robot stands
let open = false;
let followed = null; // the stop for which the table opened
let closing = 0;

function setOpen(wanted) {
  open = wanted;
  clearTimeout(closing);
  draw();
}

// The table opens with a stop, and closes by itself only when every robot was seen to stand.
function follow(last) {
  const key = last.own || last.told.by + Object.keys(last.told.robots).join();
  if (last.told.open && followed !== key) {
    followed = key;
    open = true;
    clearTimeout(closing);
    closing = 0;
  }
  const all = Object.values(last.told.robots).every((robot) => robot.standing !== null);
  if (!last.told.open && open && all && !closing) closing = setTimeout(() => setOpen(false), KEPT);
}

function draw() {
  const last = newest();
  const words = byId("stop-words");
  if (remark) [words.textContent, words.className] = [remark, ""];
  else if (last) [words.textContent, words.className] = summary(last);
  const told = last && last.told;
  if (told) follow(last);
  const place = byId("stop-detail");
  const more = byId("stop-more");
  more.hidden = !told;
  more.textContent = open ? "Hide" : "Details";
  more.setAttribute("aria-expanded", String(open));
  place.hidden = !(told && open);
  if (told && open) show(place, detail(told));
  drawButtons();
}

function drawButtons() {
  const chosen = [...store.selected].filter((id) => store.robots[id]);
  const whom = chosen.length === 1 ? label(store.robots[chosen[0]]) : chosen.length ? counted(chosen.length, "robot") : "selected";
  byId("stop-whom").textContent = whom;
}

let groups = "";
function drawGroups() {
  const found = [];
  for (const edge of Object.values(live.edges)) {
    for (const [name, robots] of Object.entries(edge.groups || {})) {
      found.push([Object.keys(live.edges).length > 1 ? `${edge.edge}/${name}` : name, robots.map((robot) => `${edge.edge}/${robot}`)]);
    }
  }
  const key = JSON.stringify(found);
  if (key === groups) return;
  groups = key;
  const choice = byId("stop-group");
  choice.parentElement.hidden = !found.length;
  show(choice, element("option", { value: "" }, "Stop group…"), found.map(([name, robots]) => element("option", { value: JSON.stringify(robots) }, name)));
}

function drawSilence() {
  const silent = silentFor();
  const place = byId("silence");
  const is = silent > SILENT;
  document.body.classList.toggle("silent", is);
  if (place.hidden === is) place.hidden = !is;
  if (is) {
    const words = store.error || (Number.isFinite(silent)
      ? `The console has said nothing for ${Math.round(silent / 1000)} s: what is shown is old. A stop still tries every way.`
      : "Waiting for the console. A stop works already.");
    if (place.textContent !== words) place.textContent = words;
  }
  const way = store.roundTrip === null ? "…" : `${Math.max(1, Math.round(store.roundTrip))} ms`;
  byId("link-words").textContent = is ? "no connection" : `${store.operator} · ${store.permission} · ${way}`;
}

export function startStopView() {
  page.changed = (words = "") => {
    remark = words;
    draw();
  };
  byId("stop-more").addEventListener("click", () => setOpen(!open));
  byId("stop-group").addEventListener("change", (event) => {
    const { value } = event.target;
    event.target.value = "";
    if (value && JSON.parse(value).length) page.stop(JSON.parse(value));
  });
  onChange((kinds) => {
    if (kinds.has("stops") || kinds.has("selection") || kinds.has("robots")) draw();
    if (kinds.has("edges")) drawGroups();
  });
  setInterval(() => {
    drawSilence();
    const last = newest();
    if (last && !last.told) draw();
  }, 100);
  draw();
}

// Release: a separate action, which first shows who stopped the robots, when and why.
export function stoppedRobots() {
  return ordered().filter((robot) => robot.emergency_stop);
}
