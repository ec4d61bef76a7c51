// The past: one slider, which takes the whole page to a second of the recordings. Robots accept no request
// from there except a stop, which acts on the present.

import { byId, duration, element, show } from "./dom.js";
import { ask, live, onChange, showMoment, store } from "./store.js";

const SPANS = { 600: "10 minutes", 3600: "1 hour", 0: "everything" }; // that the slider covers, s
const STEPS = [-60, -10, -1, 1, 10, 60]; // s
const TURN = 250; // ms between two moments during playback
const LOST = 5; // s before a moment within which something must be recorded
let extent = null; // {since, until}: Unix s
let shown = [0, 1]; // range of the slider: Unix s
let span = 600;
let wanted = null; // the moment to show, Unix s
let asking = false;
let playing = 0; // timer of the playback
let refusal = "";
let parts = null;

const inWords = (stamp) => new Date(stamp * 1000).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" });
const clamped = (value, [least, most]) => Math.min(most, Math.max(least, value));

// -- position in the past ------------------------------------------------------------------------------------

// The address of a moment: UTC, to the tenth of a second, without other state of the page.
function address(at) {
  return `#t=${new Date(Math.round(at * 10) * 100).toISOString().replace(/00Z$/, "Z")}`;
}

function momentInAddress() {
  const at = Date.parse(new URLSearchParams(location.hash.slice(1)).get("t") || "") / 1000;
  return Number.isFinite(at) ? at : null;
}

function cover(at) {
  const all = [extent.since, Math.max(extent.until, extent.since + 1)];
  if (!span || all[1] - all[0] <= span) shown = all;
  else {
    const since = clamped(at - span / 2, [all[0], all[1] - span]);
    shown = [since, since + span];
  }
}

function go(at) {
  if (!extent) return;
  wanted = clamped(at, [extent.since, Math.max(extent.until, live.time - 1)]);
  if (wanted > extent.until) extent.until = wanted;
  if (wanted < shown[0] || wanted > shown[1]) cover(wanted);
  draw();
  fetchMoment();
}

// One moment is requested at a time; meanwhile only the last selected one is kept.
function fetchMoment() {
  if (asking || wanted === null) return;
  const at = wanted;
  asking = true;
  const out = ask({ ask: "moment", at }, (answer) => {
    asking = false;
    if (wanted === null) return; // the past was left meanwhile
    refusal = answer.moment ? "" : `${answer.reason}${answer.hint ? ` (${answer.hint})` : ""}`;
    history.replaceState(null, "", address(at));
    showMoment(answer.moment || { at, recorded: 0, events: [], entries: {}, tracks: {} });
    if (wanted !== at) fetchMoment();
  });
  if (!out) asking = false;
}

function leave() {
  stopPlaying();
  wanted = null;
  refusal = "";
  history.replaceState(null, "", location.pathname);
  if (store.past) showMoment(null);
  byId("past").hidden = true;
  byId("past-open").setAttribute("aria-expanded", "false");
}

function open(at) {
  ask({ ask: "extent" }, (answer) => {
    extent = answer.extent || null;
    refusal = extent ? "" : `${answer.reason}${answer.hint ? ` (${answer.hint})` : ""}`;
    byId("past").hidden = false;
    byId("past-open").setAttribute("aria-expanded", "true");
    build();
    if (!extent) return;
    cover(at ?? extent.until);
    go(at ?? extent.until);
  });
}

// -- playback --------------------------------------------------------------------------------------------------

function stopPlaying() {
  clearInterval(playing);
  playing = 0;
  if (parts) parts.play.textContent = "Play";
}

function play() {
  if (playing) return stopPlaying();
  const began = performance.now();
  const from = wanted;
  parts.play.textContent = "Pause";
  playing = setInterval(() => {
    const at = from + (performance.now() - began) / 1000;
    if (at >= extent.until) stopPlaying();
    go(Math.min(at, extent.until));
  }, TURN);
}

// -- export ----------------------------------------------------------------------------------------------------

const EXPORTS = { 60: "last minute", 300: "last 5 minutes", 1800: "last 30 minutes" }; // before the moment, s

async function exportWindow(seconds) {
  const until = wanted;
  tellExport("Exporting…");
  try {
    const body = JSON.stringify({ since: Math.max(0, until - seconds), until });
    const answer = await fetch("/api/recording", { method: "POST", headers: window.fleetPage.headers(), body });
    if (!answer.ok) throw new Error((await answer.json()).error);
    const name = `fleet-${new Date(until * 1000).toISOString().replace(/[:.]/g, "")}.mcap`;
    const link = element("a", { href: URL.createObjectURL(await answer.blob()), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    tellExport(`${name} was saved`);
  } catch (error) {
    tellExport(`not exported: ${error.message}`);
  }
}

function tellExport(text) {
  if (parts) parts.told.textContent = text;
}

function exportChoice() {
  const may = store.permission === "admin";
  const choice = element("select", { "aria-label": "Export MCAP", disabled: !may, title: may ? "A file for Foxglove" : "It needs the permission admin" }, element("option", { value: "" }, "Export MCAP…"), ...Object.entries(EXPORTS).map(([value, text]) => element("option", { value }, text)));
  choice.addEventListener("change", () => {
    if (choice.value) exportWindow(Number(choice.value));
    choice.value = "";
  });
  return choice;
}

// -- display -----------------------------------------------------------------------------------------------------

function words() {
  if (refusal) return refusal;
  if (!store.past) return "Going there…";
  const ago = Math.max(0, live.time - store.past.at);
  const gap = store.past.at - store.past.recorded;
  const lost = gap > LOST ? ` Nothing was recorded for ${duration(gap)} before it: what is shown is older.` : "";
  return `PAST: ${inWords(store.past.at)}, ${duration(ago)} ago. Not now.${lost} Only the stop bar works, and it acts on now.`;
}

function local(at) {
  const date = new Date(at * 1000);
  return new Date(date - date.getTimezoneOffset() * 60000).toISOString().slice(0, 19);
}

function draw() {
  if (!parts) return;
  const text = words();
  if (parts.words.textContent !== text) parts.words.textContent = text;
  if (wanted === null) return;
  Object.assign(parts.slider, { min: Math.floor(shown[0]), max: Math.ceil(shown[1]), value: Math.round(wanted) });
  parts.slider.setAttribute("aria-valuetext", inWords(wanted));
  if (document.activeElement !== parts.time) parts.time.value = local(wanted);
}

async function copy(button) {
  const link = `${location.origin}/${address(wanted)}`;
  await navigator.clipboard.writeText(link).then(() => (button.textContent = "Copied"), () => (button.textContent = "It is in the address bar"));
  setTimeout(() => (button.textContent = "Copy link"), 2000);
}

function build() {
  const move = (by) => () => { stopPlaying(); go(wanted + by); };
  const slider = element("input", { type: "range", step: "1", "aria-label": "Moment of the past" });
  slider.addEventListener("input", () => { stopPlaying(); go(Number(slider.value)); });
  const time = element("input", { type: "datetime-local", step: "1", "aria-label": "Go to a time" });
  time.addEventListener("change", () => time.value && go(new Date(time.value).getTime() / 1000));
  const spans = element("select", { "aria-label": "What the slider covers" }, ...Object.entries(SPANS).map(([value, text]) => element("option", { value, selected: Number(value) === span }, text)));
  spans.addEventListener("change", () => { span = Number(spans.value); cover(wanted); draw(); });
  const steps = STEPS.map((by) => element("button", { type: "button", onclick: move(by), title: by < 0 ? "Back" : "On" }, `${by < 0 ? "−" : "+"}${duration(Math.abs(by))}`));
  const button = (text, onclick, more = {}) => element("button", { type: "button", onclick, ...more }, text);
  parts = { words: element("p", { role: "status" }), slider, time, play: button("Play", play), told: element("small", { role: "status" }) };
  const link = button("Copy link", () => copy(link));
  const now = button("Back to now", leave, { class: "now" });
  show(byId("past"), parts.words, ...(extent ? [slider, spans, time, ...steps, parts.play, link, exportChoice(), parts.told] : []), now);
  draw();
}

export function startPast() {
  byId("past-open").addEventListener("click", () => (byId("past").hidden ? open(null) : leave()));
  addEventListener("hashchange", () => {
    const at = momentInAddress();
    if (at !== null) open(at);
  });
  onChange((kinds) => {
    if (kinds.has("open") && wanted === null && momentInAddress() !== null) open(momentInAddress());
    else if (kinds.has("open")) { asking = false; fetchMoment(); }
    if (!kinds.has("past")) return;
    document.body.classList.toggle("past", Boolean(store.past));
    document.title = store.past ? "PAST · fleet console" : "fleet console";
    draw();
  });
  setInterval(draw, 1000);
}
