// Plots of the numbers that the selected robot reports. Values are kept while it is selected, so that a new
// plot shows earlier values. uPlot is loaded with the first plot.

import { element } from "./dom.js";
import { onChange, store } from "./store.js";

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
  times.push(store.time);
  values.push(value);
  while (times.length > MOST || store.time - times[0] > KEPT) {
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
  const robot = store.robots[id];
  if (!robot) return;
  const found = { ...store.numbers[id] };
  if (robot.speed !== null) found.speed = robot.speed;
  for (const [name, value] of Object.entries(found)) keep(name, value);
  for (const [name, chart] of charts) if (series[name]) chart.setData(series[name]);
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

function chartOf(place, name) {
  const axis = { stroke: color("--dim"), grid: { stroke: color("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
  const options = {
    width: place.clientWidth || 280,
    height: HEIGHT,
    legend: { show: false },
    cursor: { y: false },
    series: [{}, { stroke: color("--accent"), width: 1.5, points: { show: false } }],
    axes: [{ ...axis, size: 26, space: 70, values: (_, stamps) => stamps.map(clock) }, { ...axis, size: 48 }],
  };
  charts.set(name, new uPlot(options, series[name] || [[], []], place));
}

function row(name) {
  const value = series[name]?.[1].at(-1);
  const words = element("span", { class: "value" }, value === undefined ? "not reported" : String(Number(value.toPrecision(5))));
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

function names() {
  return Object.keys(series).sort((one, other) => one.localeCompare(other, undefined, { numeric: true }));
}

export function plotsKey() {
  return [shown, names()];
}

export function plots() {
  const found = names();
  if (!found.length && !shown.length) return [element("h3", {}, "Plots"), element("p", { class: "dim" }, "It has reported no number yet.")];
  const choice = element("select", { "aria-label": "Add a plot" }, element("option", { value: "" }, "Plot a number…"), ...found.filter((name) => !shown.includes(name)).map((name) => element("option", { value: name }, name)));
  choice.addEventListener("change", () => {
    if (!choice.value) return;
    loading ??= load();
    shown = [...shown, choice.value];
    redraw();
  });
  for (const [name, chart] of charts) {
    chart.destroy();
    charts.delete(name);
  }
  return [element("h3", {}, "Plots"), choice, ...shown.map(row)];
}

function tellValues() {
  for (const each of document.querySelectorAll(".plot")) {
    const value = series[each.dataset.number]?.[1].at(-1);
    if (value !== undefined) each.querySelector(".value").textContent = String(Number(value.toPrecision(5)));
  }
}

export function startPlots(call) {
  redraw = call;
  onChange((kinds) => {
    if (store.past) return;
    if (!kinds.has("numbers") && !kinds.has("robots") && !kinds.has("selection")) return;
    take();
    tellValues();
  });
}
