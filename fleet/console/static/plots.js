// Plots of the numbers that the selected robot reports. Values are kept while it is selected, so that a new
// plot shows earlier values; in the past they show the recorded ones around the moment. uPlot is loaded with
// the first plot.

import { duration, element } from "./dom.js";
import { MOST as MOST_PLOTS, SHOWN, byName, pastNames, pastSeries, pastValue, pastWords, startPastPlots, wantSeries } from "./pastplots.js";
import { live, onChange, store } from "./store.js";

const KEPT = 120; // s
const MOST = 1500; // values of one number
const HEIGHT = 130; // px
const series = {}; // [times, values] of the selected robot, by number
const charts = new Map(); // plot by number
let shown = []; // plotted numbers; kept for the next robot, if it has them
let whose = "";
let loading = null;
let redraw = () => {};

// -- numbers -----------------------------------------------------------------------------------------------

function keep(name, value) {
  const [times, values] = (series[name] ??= [[], []]);
  times.push(live.time);
  values.push(value);
  while (times.length > MOST || live.time - times[0] > KEPT) {
    times.shift();
    values.shift();
  }
}

function take() {
  const id = store.selected.size === 1 ? [...store.selected][0] : "";
  if (id !== whose) {
    whose = id;
    for (const name of Object.keys(series)) delete series[name];
  }
  for (const [name, value] of Object.entries(live.numbers[id] || {})) keep(name, value);
}

const shownSeries = (name) => (store.past ? pastSeries(name) : series[name]) || [[], []];

const names = () => (store.past ? pastNames() : Object.keys(series).sort(byName));

const figure = (value) => String(Number(value.toPrecision(5)));

function valueOf(name) {
  if (!store.past) return series[name] ? figure(series[name][1].at(-1)) : "not reported";
  const found = pastValue(name);
  if (!found) return "not recorded";
  return figure(found.value) + (found.age ? ` (${duration(found.age)} before)` : "");
}

// -- plots ---------------------------------------------------------------------------------------------------

function load() {
  const script = document.createElement("script");
  script.src = "/vendor/uPlot.iife.min.js";
  const style = element("link", { rel: "stylesheet", href: "/vendor/uPlot.min.css" });
  document.head.append(script, style);
  return new Promise((resolve, reject) => {
    script.onload = resolve;
    script.onerror = reject;
  });
}

const color = (name) => () => getComputedStyle(document.body).getPropertyValue(name).trim();

const clock = (stamp) => new Date(stamp * 1000).toTimeString().slice(0, 8);

// In the past: a line at the moment, in the middle of what is shown.
function drawMoment(chart) {
  if (!store.past) return;
  const { ctx, bbox } = chart;
  ctx.fillStyle = color("--past")();
  ctx.fillRect(Math.round(chart.valToPos(store.past.at, "x", true)) - 1, bbox.top, 2, bbox.height);
}

// Single values of the past are no line.
const areSparse = (_chart, _series, first, last) => Boolean(store.past) && last - first < 2 * SHOWN;

const range = (_chart, least, most) => (store.past ? [store.past.at - SHOWN, store.past.at + SHOWN] : [least, most]);

function chartOf(place, name) {
  const axis = { stroke: color("--dim"), grid: { stroke: color("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
  const options = {
    width: place.clientWidth || 280,
    height: HEIGHT,
    legend: { show: false },
    cursor: { y: false },
    scales: { x: { range } },
    hooks: { draw: [drawMoment] },
    series: [{}, { stroke: color("--accent"), width: 1.5, points: { show: areSparse, size: 3 } }],
    axes: [{ ...axis, size: 26, space: 70, values: (_, stamps) => stamps.map(clock) }, { ...axis, size: 48 }],
  };
  charts.set(name, new uPlot(options, shownSeries(name), place));
}

function row(name) {
  const words = element("span", { class: "value" }, valueOf(name));
  const place = element("div", { class: "chart", role: "img", "aria-label": `Plot of ${name}` });
  const close = () => {
    shown = shown.filter((each) => each !== name);
    redraw();
  };
  charts.get(name)?.destroy();
  charts.delete(name);
  loading.then(() => place.isConnected && chartOf(place, name));
  return element("div", { class: "plot", data: { number: name } }, element("div", { class: "head" }, element("b", {}, name.replaceAll(".", ".\u200b").replaceAll("_", "_\u200b")), words, element("button", { type: "button", class: "link", onclick: close, "aria-label": `Close the plot of ${name}` }, "close")), place);
}

export function plotsKey() {
  return [shown, names(), Boolean(store.past), store.past && pastWords()];
}

export function plots() {
  const found = names();
  const none = !found.length && !shown.length && !store.past ? "It has reported no number yet." : "";
  const words = store.past ? pastWords() : none;
  const told = words ? element("p", { class: "dim", role: "status" }, words) : "";
  if (!found.length && !shown.length) return [element("h3", {}, "Plots"), told];
  const choice = element("select", { "aria-label": "Add a plot", disabled: shown.length >= MOST_PLOTS }, element("option", { value: "" }, "Plot a number…"), ...found.filter((name) => !shown.includes(name)).map((name) => element("option", { value: name }, name)));
  choice.addEventListener("change", () => {
    if (!choice.value) return;
    loading ??= load();
    shown = [...shown, choice.value];
    redraw();
    wantSeries();
  });
  for (const [name, chart] of charts) {
    chart.destroy();
    charts.delete(name);
  }
  return [element("h3", {}, "Plots"), told, choice, ...shown.map(row)];
}

function update() {
  for (const [name, chart] of charts) chart.setData(shownSeries(name));
  for (const each of document.querySelectorAll(".plot")) each.querySelector(".value").textContent = valueOf(each.dataset.number);
}

export function startPlots(call) {
  redraw = call;
  startPastPlots(() => shown, () => {
    redraw();
    update();
  });
  onChange((kinds) => {
    if (!["numbers", "robots", "selection", "past"].some((kind) => kinds.has(kind))) return;
    take();
    if (!store.past || kinds.has("past") || kinds.has("selection")) update();
  });
}
