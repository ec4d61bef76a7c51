// The recorded numbers of the selected robot around a moment of the past, for its plots. More is read than is
// shown, so that small moves of the slider need no reading.

import { ask, live, onChange, store } from "./store.js";

export const SHOWN = 60; // s before and after the moment
const READ = 150; // s before and after the moment
const POINTS = 800; // of one number
const SETTLED = 200; // ms without a move until reading
const FRESH = 5; // s of a move after which the newest values are read again
const GAP = 5; // s without a value: the line is broken there
export const MOST = 20; // numbers in one request

let read = null; // {robot, at, known, names, values, words}; known: Unix s until which all was recorded
let asking = false;
let timer = 0;
let wanted = () => [];
let told = () => {};

export const byName = (one, other) => one.localeCompare(other, undefined, { numeric: true });

const chosen = () => (store.selected.size === 1 ? [...store.selected][0] : "");
const shows = () => (read && read.robot === chosen() ? read : null);

function isEnough(robot, at, names) {
  if (!read || read.robot !== robot || names.some((name) => !read.values[name])) return false;
  const moved = Math.abs(at - read.at);
  return moved <= READ - SHOWN && (at + SHOWN <= read.known || moved < FRESH);
}

// A line between two distant values would show what was not recorded.
export function broken([times, values]) {
  const found = [[], []];
  times.forEach((at, number) => {
    const before = times[number - 1];
    if (at - before > GAP) {
      found[0].push((before + at) / 2);
      found[1].push(null);
    }
    found[0].push(at);
    found[1].push(values[number]);
  });
  return found;
}

function wordsOf({ names, share, problems }) {
  const found = [...problems];
  if (share < 1) found.push(`only ${Math.floor(share * 100)} % of these minutes were read, evenly spread: they are large`);
  if (!names.length) found.push("no number was recorded around this moment");
  return found.join("; ");
}

function take(answer, asked) {
  const { series } = answer;
  const values = Object.fromEntries(asked.names.map((name) => [name, series ? broken(series.values[name]) : [[], []]]));
  const words = series ? wordsOf(series) : `${answer.reason}${answer.hint ? ` (${answer.hint})` : ""}`;
  read = { ...asked, values, words, names: series ? series.names.sort(byName) : [] };
}

function fetchSeries() {
  if (asking || !store.past || !chosen()) return;
  const asked = { robot: chosen(), at: store.past.at, known: Math.min(store.past.at + READ, live.time), names: wanted().slice(0, MOST) };
  if (isEnough(asked.robot, asked.at, asked.names)) return;
  const window = { since: Math.max(0, asked.at - READ), until: asked.at + READ, points: POINTS };
  asking = ask({ ask: "series", robot: asked.robot, names: asked.names, ...window }, (answer) => {
    asking = false;
    take(answer, asked);
    told();
    fetchSeries();
  });
}

export function wantSeries() {
  clearTimeout(timer);
  timer = setTimeout(fetchSeries, SETTLED);
}

export const pastNames = () => shows()?.names || [];

export const pastSeries = (name) => shows()?.values[name];

// The last value of a number at the moment and its age in s; undefined without one.
export function pastValue(name) {
  const [times, values] = pastSeries(name) || [[], []];
  const last = times.findLastIndex((at, number) => at <= store.past.at && values[number] !== null);
  const age = store.past.at - times[last];
  return age <= SHOWN ? { value: values[last], age: age > GAP ? age : 0 } : undefined;
}

// What is missing in the plots, empty if nothing is.
export function pastWords() {
  return shows() ? read.words : "Reading the recording…";
}

export function startPastPlots(names, call) {
  wanted = names;
  told = call;
  onChange((kinds) => {
    if (kinds.has("open")) asking = false;
    if (!store.past) read = null;
    else if (["past", "selection", "open"].some((kind) => kinds.has(kind))) wantSeries();
  });
}
