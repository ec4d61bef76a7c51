// A rehearsal: the progress of a mission with simulated robots, shown as ghosts on the map, with a slider.

import { counted, element } from "./dom.js";
import { order } from "./answers.js";
import { store } from "./store.js";

const TURN = 100; // ms between two moments during playback
const FAST = 4; // simulated seconds per second

// The last rehearsal of this page: its mission, progress, result, and the shown moment.
export const rehearsal = { mission: null, seconds: 0, step: "", notes: [], result: null, at: 0 };
let changed = () => {};
let playing = 0;
let shown = null; // elements that follow the slider
let moved = () => {};

export function rehearse(mission, inputs) {
  stopPlaying();
  Object.assign(rehearsal, { mission, seconds: 0, step: "", notes: [], result: null, at: 0 });
  order({ ask: "rehearse", edge: mission.edge, name: mission.name, inputs }, `rehearse ${mission.name}`, (answer) => {
    if (rehearsal.mission !== mission) return;
    if (answer.status !== "accepted") return close();
    const told = answer.rehearsal;
    Object.assign(rehearsal, { seconds: told.seconds || 0, step: told.step || "", result: told.result || null });
    rehearsal.notes.push(...(told.notes || []));
    changed();
  });
  changed();
}

function close() {
  stopPlaying();
  Object.assign(rehearsal, { mission: null, result: null });
  changed();
}

// -- ghosts ----------------------------------------------------------------------------------------------------

// The position on a track at a moment of the rehearsal: x, y, z and the direction of motion.
export function placeAt(points, at) {
  const next = points.findIndex(([moment]) => moment > at);
  if (next === 0) return [...points[0].slice(1), null];
  if (next < 0) return [...points[points.length - 1].slice(1), headingAt(points, points.length - 1)];
  const [from, to] = [points[next - 1], points[next]];
  const share = (at - from[0]) / (to[0] - from[0] || 1);
  const place = [1, 2, 3].map((axis) => from[axis] + share * (to[axis] - from[axis]));
  return [...place, headingAt(points, next)];
}

// The direction of the last non-zero movement before a point.
function headingAt(points, last) {
  for (let number = last; number > 0; number -= 1) {
    const [east, north] = [points[number][1] - points[number - 1][1], points[number][2] - points[number - 1][2]];
    if (Math.hypot(east, north) > 0.02) return Math.atan2(north, east);
  }
  return null;
}

// The robots of the shown rehearsal at its moment.
export function ghosts() {
  if (!rehearsal.result || store.past) return [];
  return (rehearsal.result.tracks || []).map((track) => ({ name: track.robot, way: track.points, place: placeAt(track.points, rehearsal.at) }));
}

// -- panel -------------------------------------------------------------------------------------------------------

const clock = (seconds) => `${seconds.toFixed(1)} s`;

function go(at) {
  const end = rehearsal.result.seconds;
  rehearsal.at = Math.min(end, Math.max(0, at));
  if (!shown) return;
  shown.slider.value = rehearsal.at;
  shown.slider.setAttribute("aria-valuetext", `${clock(rehearsal.at)} of ${clock(end)}`);
  shown.words.textContent = `${clock(rehearsal.at)} of ${clock(end)}`;
  for (const row of shown.rows) row.classList.toggle("now", Number(row.dataset.began) <= rehearsal.at && rehearsal.at < Number(row.dataset.ended));
  shown.moved();
}

function stopPlaying() {
  clearInterval(playing);
  playing = 0;
  if (shown) shown.play.textContent = "Play";
}

function play() {
  if (playing) return stopPlaying();
  if (rehearsal.at >= rehearsal.result.seconds) go(0);
  shown.play.textContent = "Pause";
  playing = setInterval(() => {
    go(rehearsal.at + (FAST * TURN) / 1000);
    if (rehearsal.at >= rehearsal.result.seconds) stopPlaying();
  }, TURN);
}

function robotRow(robot) {
  const battery = robot.battery_before !== undefined && robot.battery_left !== undefined ? `${Math.round(robot.battery_before)} % to ${Math.round(robot.battery_left)} %` : "–";
  return element("tr", {}, element("th", { scope: "row" }, robot.robot), element("td", {}, robot.outcome || "not through"), element("td", {}, battery), element("td", { class: "dim" }, robot.played_by));
}

function partRow(part, end) {
  const ended = part.ended ?? end;
  const how = `${part.outcome || "under way"}${part.reason ? `: ${part.reason}` : ""}`;
  return element("tr", { class: "part-row", data: { began: part.began, ended } }, element("td", {}, clock(part.began)), element("th", { scope: "row" }, part.step), element("td", {}, `${part.robot} ${part.does}: ${how}`));
}

function approach(result) {
  const nearest = result.approaches?.[0];
  if (!nearest) return "Closest approach: unknown; no two robots are placed in the site's frame, or none moved.";
  return `Closest approach: ${nearest.robots.join(" and ")}, ${nearest.metres.toFixed(2)} m after ${clock(nearest.at)}; ${nearest.kept} m are kept.`;
}

function timeline(result) {
  const end = result.seconds;
  const rows = (result.timeline || []).map((part) => partRow(part, end));
  const slider = element("input", { type: "range", min: "0", max: String(end), step: "0.1", value: String(rehearsal.at), "aria-label": "Moment of the rehearsal" });
  slider.addEventListener("input", () => { stopPlaying(); go(Number(slider.value)); });
  const words = element("small", { role: "status" });
  const button = element("button", { type: "button", onclick: play }, playing ? "Pause" : "Play");
  shown = { slider, words, rows, play: button, moved };
  go(rehearsal.at);
  const tracks = (result.tracks || []).length;
  const seen = tracks ? `${counted(tracks, "robot")} on the map as ghosts; ${FAST} times as fast.` : "No robot is on the map: none is placed in the site's frame.";
  return [element("div", { class: "row scrub" }, button, slider, words), element("p", { class: "dim" }, seen), element("table", {}, ...rows)];
}

function shownResult(result) {
  const failed = result.troubles || [];
  const word = failed.length ? "not passed" : "passed";
  const robots = (result.robots || []).filter((robot) => robot.role);
  return [
    element("p", {}, element("b", {}, `${result.mission}: ${word}`), ` (${result.outcome}), ${clock(result.seconds)} simulated`),
    ...failed.map((text) => element("p", { class: "cause fault" }, text)),
    ...timeline(result),
    element("p", {}, approach(result)),
    element("table", {}, ...robots.map(robotRow)),
    ...(result.assumed || []).map((text) => element("p", { class: "dim" }, `Taken for granted: ${text}.`)),
  ];
}

function progress() {
  const last = rehearsal.notes[rehearsal.notes.length - 1];
  const where = rehearsal.step ? `step ${rehearsal.step}` : "the simulated robots start";
  return [element("p", { role: "status" }, `${rehearsal.mission.name}: ${clock(rehearsal.seconds)}, ${where}`), element("p", { class: "dim" }, last ? last.text : "")];
}

export const rehearsalKey = () => rehearsal.mission && [rehearsal.mission.name, rehearsal.result || [rehearsal.seconds, rehearsal.step, rehearsal.notes.length]];

export function rehearsed() {
  shown = null;
  if (!rehearsal.mission) return [];
  const body = rehearsal.result ? shownResult(rehearsal.result) : progress();
  return [element("h3", {}, "Rehearsal"), element("div", { class: "run rehearsal" }, ...body, element("div", { class: "row" }, element("button", { type: "button", class: "plain", onclick: close }, "Close")))];
}

// ``redraw`` draws the panel, ``map`` the map, ``fit`` fits its content into the view.
export function startRehearsal(redraw, map, fit) {
  moved = map;
  changed = () => { redraw(); fit(); map(); };
}

// For programs that drive the page: the positions of the ghosts.
window.fleetPage.ghosts = () => ghosts().map(({ name, place }) => [name, ...place]);
