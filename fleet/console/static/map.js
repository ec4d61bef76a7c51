// The map: the site's metric frame on a canvas. x is east, y is north, metres.

import { byId, counted, element, show } from "./dom.js";
import { order } from "./answers.js";
import { label, mapped, onChange, select, staleness, store } from "./store.js";

const GRIP = 14; // px around a robot that are the robot
const DRAG = 5; // px that a pointer moves before it is a drag
const LEAST = 0.5; // px per metre
const MOST = 400;
const canvas = byId("map");
const paint = canvas.getContext("2d");
const view = { x: 0, y: 0, scale: 30, fitted: "", touched: false }; // fitted: to which robots
const pointers = new Map();
let size = { width: 0, height: 0 };
let drag = null; // {kind: "box" or "pan", from, to}
let target = null; // {x, y}: where the selected robots may be sent
let colors = {};
let dirty = true;

const toScreen = (x, y) => [size.width / 2 + (x - view.x) * view.scale, size.height / 2 - (y - view.y) * view.scale];
const toSite = (px, py) => [view.x + (px - size.width / 2) / view.scale, view.y - (py - size.height / 2) / view.scale];

function readColors() {
  const style = getComputedStyle(document.documentElement);
  const names = ["ink", "dim", "line", "line-strong", "ok", "degraded", "fault", "offline", "accent", "paper", "track", "place"];
  colors = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

function resize() {
  const box = canvas.parentElement.getBoundingClientRect();
  const ratio = devicePixelRatio || 1;
  size = { width: box.width, height: box.height };
  canvas.width = Math.round(box.width * ratio);
  canvas.height = Math.round(box.height * ratio);
  paint.setTransform(ratio, 0, 0, ratio, 0, 0);
  if (!view.touched) fit();
  dirty = true;
}

const whoIsMapped = () => mapped().map((robot) => robot.id).join();

function fit() {
  const points = mapped().map((robot) => store.poses[robot.id].slice(0, 2));
  for (const way of Object.values(store.goals)) points.push(...way.map((point) => [point[0], point[1]]));
  if (!points.length) return;
  const xs = points.map((point) => point[0]);
  const ys = points.map((point) => point[1]);
  const [west, east, south, north] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  view.x = (west + east) / 2;
  view.y = (south + north) / 2;
  const across = Math.max(east - west, 4) * 1.5;
  const up = Math.max(north - south, 4) * 1.5;
  view.scale = Math.min(MOST, Math.max(LEAST, Math.min(size.width / across, size.height / up)));
  view.fitted = whoIsMapped();
  dirty = true;
}

function zoom(factor, px = size.width / 2, py = size.height / 2) {
  view.touched = true;
  const [x, y] = toSite(px, py);
  view.scale = Math.min(MOST, Math.max(LEAST, view.scale * factor));
  const [nx, ny] = toSite(px, py);
  view.x += x - nx;
  view.y += y - ny;
  dirty = true;
}

// -- drawing ---------------------------------------------------------------------------------------------

function spacing() {
  const wanted = 70 / view.scale;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= wanted);
}

function drawGrid() {
  const step = spacing();
  const [west, north] = toSite(0, 0);
  const [east, south] = toSite(size.width, size.height);
  paint.font = "11px system-ui, sans-serif";
  paint.lineWidth = 1;
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  for (let x = Math.ceil(west / step) * step; x <= east; x += step) drawLine(x, null, step, digits);
  for (let y = Math.ceil(south / step) * step; y <= north; y += step) drawLine(null, y, step, digits);
}

function drawLine(x, y, step, digits) {
  const value = x ?? y;
  const [px, py] = toScreen(x ?? 0, y ?? 0);
  const at = Math.round(x === null ? py : px) + 0.5;
  paint.strokeStyle = Math.abs(value) < step / 1000 ? colors["line-strong"] : colors.line;
  paint.beginPath();
  if (x !== null) paint.moveTo(at, 0), paint.lineTo(at, size.height);
  else paint.moveTo(0, at), paint.lineTo(size.width, at);
  paint.stroke();
  paint.fillStyle = colors.dim;
  paint.textAlign = "left";
  const text = Math.abs(value) < step / 1000 ? "0" : value.toFixed(digits);
  if (x !== null) paint.fillText(text, at + 3, size.height - 6);
  else paint.fillText(text, 4, at - 3);
}

function polygon(points) {
  paint.beginPath();
  points.forEach(([x, y], number) => {
    const at = toScreen(x, y);
    if (number) paint.lineTo(...at);
    else paint.moveTo(...at);
  });
  paint.closePath();
}

function drawPlaces() {
  for (const edge of Object.values(store.edges)) {
    for (const place of Object.values(edge.places || {})) {
      if ((place.frame || "site") === "site") drawPlace(place);
    }
  }
}

function drawPlace(place) {
  const [px, py] = toScreen(place.at[0], place.at[1]);
  paint.strokeStyle = paint.fillStyle = colors.place;
  paint.setLineDash([]);
  paint.lineWidth = 1.5;
  if (place.polygon?.length) polygon(place.polygon);
  else {
    paint.beginPath();
    paint.arc(px, py, Math.max(5, (place.radius || 0.2) * view.scale), 0, 2 * Math.PI);
  }
  paint.globalAlpha = 0.12;
  paint.fill();
  paint.globalAlpha = 1;
  paint.stroke();
  paint.textAlign = "center";
  paint.fillText(place.name, px, py + 4);
}

// Fences are told in each robot's own world; it is placed in the site's frame by its state.
function drawFences() {
  for (const [id, told] of Object.entries(store.descriptions)) {
    const robot = store.robots[id];
    if (!robot || !store.selected.has(id) || !told.fence) continue;
    const { origin = { x: 0, y: 0 }, yaw = 0 } = robot.placement || {};
    const moved = (points) => points.map(([x, y]) => [origin.x + x * Math.cos(yaw) - y * Math.sin(yaw), origin.y + x * Math.sin(yaw) + y * Math.cos(yaw)]);
    paint.lineWidth = 2;
    paint.setLineDash([8, 5]);
    paint.strokeStyle = colors.accent;
    for (const points of told.fence.inclusion || []) polygon(moved(points)), paint.stroke();
    paint.strokeStyle = paint.fillStyle = colors.fault;
    for (const points of told.fence.exclusion || []) {
      polygon(moved(points));
      paint.stroke();
      paint.globalAlpha = 0.1;
      paint.fill();
      paint.globalAlpha = 1;
    }
    paint.setLineDash([]);
  }
}

function drawTrack(id) {
  const track = store.tracks[id] || [];
  if (track.length < 2) return;
  paint.strokeStyle = colors.track;
  paint.lineWidth = 2;
  paint.beginPath();
  track.forEach(([x, y], number) => (number ? paint.lineTo(...toScreen(x, y)) : paint.moveTo(...toScreen(x, y))));
  paint.stroke();
}

function drawGoal(id) {
  const way = store.goals[id];
  const pose = store.poses[id];
  if (!way?.length || !pose) return;
  paint.strokeStyle = colors.accent;
  paint.lineWidth = 1.5;
  paint.setLineDash([4, 4]);
  paint.beginPath();
  paint.moveTo(...toScreen(pose[0], pose[1]));
  for (const [x, y] of way) paint.lineTo(...toScreen(x, y));
  paint.stroke();
  paint.setLineDash([]);
  cross(way[way.length - 1], 6);
}

function cross([x, y], reach) {
  const [px, py] = toScreen(x, y);
  paint.beginPath();
  paint.moveTo(px - reach, py - reach), paint.lineTo(px + reach, py + reach);
  paint.moveTo(px - reach, py + reach), paint.lineTo(px + reach, py - reach);
  paint.stroke();
}

function arrow(px, py, yaw, reach) {
  const at = (angle, far) => [px + Math.cos(yaw + angle) * far, py - Math.sin(yaw + angle) * far];
  paint.beginPath();
  paint.moveTo(...at(0, reach));
  paint.lineTo(...at(2.5, reach));
  paint.lineTo(...at(Math.PI, reach * 0.4));
  paint.lineTo(...at(-2.5, reach));
  paint.closePath();
}

function drawRobot(robot) {
  const pose = store.poses[robot.id];
  const [px, py] = toScreen(pose[0], pose[1]);
  const old = staleness(robot) || robot.health === "offline";
  const color = old ? colors.offline : colors[robot.health] || colors.fault;
  if (store.selected.has(robot.id)) {
    paint.fillStyle = colors.accent;
    paint.globalAlpha = 0.22;
    paint.beginPath();
    paint.arc(px, py, 24, 0, 2 * Math.PI);
    paint.fill();
    paint.globalAlpha = 1;
  }
  if (pose[3] === null || pose[3] === undefined) {
    paint.beginPath();
    paint.arc(px, py, 8, 0, 2 * Math.PI);
  } else arrow(px, py, pose[3], 15);
  // A simulated robot is an outline; a real one is filled.
  paint.strokeStyle = paint.fillStyle = color;
  paint.lineWidth = 2;
  if (robot.simulated || old) {
    paint.save();
    paint.fillStyle = colors.paper;
    paint.fill();
    paint.restore();
    paint.setLineDash(robot.simulated ? [4, 2.5] : []);
    paint.stroke();
    paint.setLineDash([]);
  } else paint.fill();
  if (robot.emergency_stop) drawHalt(px, py);
  drawLabel(robot, pose, px, py);
}

function drawHalt(px, py) {
  paint.strokeStyle = colors.fault;
  paint.lineWidth = 2.5;
  paint.beginPath();
  for (let side = 0; side <= 8; side += 1) {
    const angle = Math.PI / 8 + (side * Math.PI) / 4;
    paint.lineTo(px + 20 * Math.cos(angle), py + 20 * Math.sin(angle));
  }
  paint.stroke();
}

function drawLabel(robot, pose, px, py) {
  const words = [label(robot)];
  if (robot.simulated) words.push("sim");
  if (Math.abs(pose[2]) > 0.5) words.push(`${pose[2].toFixed(1)} m up`);
  const text = words.join(" · ");
  paint.font = "600 12px system-ui, sans-serif";
  paint.textAlign = "center";
  paint.lineWidth = 4;
  paint.strokeStyle = colors.paper;
  paint.strokeText(text, px, py + 36);
  paint.fillStyle = colors.ink;
  paint.fillText(text, px, py + 36);
}

function drawBox() {
  if (drag?.kind !== "box") return;
  const [from, to] = [drag.from, drag.to];
  paint.strokeStyle = paint.fillStyle = colors.accent;
  paint.lineWidth = 1;
  paint.globalAlpha = 0.12;
  paint.fillRect(from[0], from[1], to[0] - from[0], to[1] - from[1]);
  paint.globalAlpha = 1;
  paint.strokeRect(from[0] + 0.5, from[1] + 0.5, to[0] - from[0], to[1] - from[1]);
}

function tellFrame(there) {
  const robots = Object.values(store.robots).length;
  const own = there.length > 0 && !store.poses[there[0].id][4];
  let words = own ? "Each robot in a frame of its own: none is placed in the site's." : "";
  if (!own && robots > there.length) words = `${counted(robots - there.length, "robot")} not on the map: not placed in the site's frame.`;
  const place = byId("map-words");
  if (place.textContent !== words) place.textContent = words;
}

function draw() {
  requestAnimationFrame(draw);
  if (!dirty) return;
  dirty = false;
  paint.clearRect(0, 0, size.width, size.height);
  drawGrid();
  drawPlaces();
  drawFences();
  const there = mapped();
  tellFrame(there);
  for (const robot of there) drawTrack(robot.id);
  for (const robot of there) drawGoal(robot.id);
  for (const robot of there) drawRobot(robot);
  if (target) {
    paint.strokeStyle = colors.accent;
    paint.lineWidth = 2.5;
    cross([target.x, target.y], 9);
  }
  drawBox();
}

// -- hands -----------------------------------------------------------------------------------------------

const place = (event) => {
  const box = canvas.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};

function robotAt([px, py]) {
  const near = mapped()
    .map((robot) => [robot.id, Math.hypot(...toScreen(...store.poses[robot.id]).map((value, axis) => value - [px, py][axis]))])
    .filter(([, away]) => away <= GRIP)
    .sort((one, other) => one[1] - other[1]);
  return near[0]?.[0];
}

function down(event) {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, place(event));
  const kind = event.pointerType === "touch" || event.button !== 0 ? "pan" : "box";
  drag = pointers.size === 1 ? { wanted: kind, kind: "", from: place(event), to: place(event), last: place(event) } : { kind: "pinch" };
}

function moved(event) {
  if (!pointers.has(event.pointerId) || !drag) return;
  const before = pinch();
  pointers.set(event.pointerId, place(event));
  if (drag.kind === "pinch") {
    const after = pinch();
    if (before && after) zoom(after.apart / before.apart, ...after.middle);
    return;
  }
  drag.to = place(event);
  if (!drag.kind && Math.hypot(drag.to[0] - drag.from[0], drag.to[1] - drag.from[1]) > DRAG) drag.kind = drag.wanted;
  if (drag.kind === "pan") {
    view.touched = true;
    view.x -= (drag.to[0] - drag.last[0]) / view.scale;
    view.y += (drag.to[1] - drag.last[1]) / view.scale;
    placeTarget();
  }
  drag.last = drag.to;
  dirty = true;
}

function pinch() {
  if (pointers.size !== 2) return null;
  const [one, other] = [...pointers.values()];
  return { apart: Math.max(1, Math.hypot(one[0] - other[0], one[1] - other[1])), middle: [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2] };
}

function up(event) {
  if (!pointers.delete(event.pointerId) || !drag) return;
  const was = drag;
  if (!pointers.size) drag = null;
  dirty = true;
  if (was.kind === "box") chooseBox(was, event);
  else if (!was.kind && was.wanted) clicked(event);
}

function chooseBox({ from, to }, event) {
  const within = (value, one, other) => value >= Math.min(one, other) && value <= Math.max(one, other);
  const ids = mapped().map((robot) => robot.id);
  const found = ids.filter((id) => {
    const [px, py] = toScreen(store.poses[id][0], store.poses[id][1]);
    return within(px, from[0], to[0]) && within(py, from[1], to[1]);
  });
  aim(null);
  select(found, { add: event.shiftKey && found.length > 0 });
}

function clicked(event) {
  if (event.button > 0) return;
  const robot = robotAt(place(event));
  if (robot) {
    aim(null);
    select([robot], { add: event.shiftKey || event.ctrlKey || event.metaKey });
  } else if (store.selected.size && !target) aim(toSite(...place(event)));
  else aim(null);
}

// -- where the selected robots shall go --------------------------------------------------------------------

function aim(point) {
  target = point ? { x: point[0], y: point[1] } : null;
  dirty = true;
  const form = byId("target");
  form.hidden = !target;
  if (!target) return;
  const robots = [...store.selected].map((id) => store.robots[id]).filter(Boolean);
  const whom = robots.length === 1 ? label(robots[0]) : counted(robots.length, "robot");
  const go = element("button", { class: "primary", disabled: store.permission === "view" }, "Go");
  const spread = robots.length > 1 ? element("label", {}, element("span", {}, "apart"), element("input", { name: "spacing", type: "number", min: "0.5", step: "0.5", value: "2" }), element("small", {}, "m")) : null;
  const words = `Send ${whom} to ${target.x.toFixed(1)}, ${target.y.toFixed(1)}`;
  show(form, element("p", {}, words), spread, element("div", { class: "row" }, go, element("button", { type: "button", class: "plain", onclick: () => aim(null) }, "Cancel")));
  form.onsubmit = (event) => {
    event.preventDefault();
    const asked = { ask: "goto", robots: robots.map((robot) => robot.id), x: target.x, y: target.y };
    if (spread) asked.spacing = Number(form.elements.spacing.value) || 2;
    order(asked, `${whom} to ${target.x.toFixed(1)}, ${target.y.toFixed(1)}`);
    aim(null);
    canvas.focus();
  };
  placeTarget();
  go.focus({ preventScroll: true });
}

function placeTarget() {
  if (!target) return;
  const form = byId("target");
  const [px, py] = toScreen(target.x, target.y);
  form.style.left = `${Math.min(size.width - 220, Math.max(8, px + 16))}px`;
  form.style.top = `${Math.min(size.height - 120, Math.max(8, py - 20))}px`;
}

const KEYS = {
  "+": () => zoom(1.25),
  "=": () => zoom(1.25),
  "-": () => zoom(0.8),
  f: fit,
  ArrowLeft: () => (view.x -= 40 / view.scale),
  ArrowRight: () => (view.x += 40 / view.scale),
  ArrowUp: () => (view.y += 40 / view.scale),
  ArrowDown: () => (view.y -= 40 / view.scale),
  Escape: () => aim(null),
};

export function startMap() {
  readColors();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    readColors();
    dirty = true;
  });
  new ResizeObserver(resize).observe(canvas.parentElement);
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointermove", moved);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoom(Math.exp(-event.deltaY / 400), ...place(event));
      placeTarget();
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    const call = KEYS[event.key];
    if (!call || event.ctrlKey || event.metaKey) return;
    call();
    if (event.key.startsWith("Arrow")) view.touched = true;
    placeTarget();
    dirty = true;
  });
  byId("target").addEventListener("keydown", (event) => event.key === "Escape" && aim(null));
  byId("zoom-in").addEventListener("click", () => zoom(1.25));
  byId("zoom-out").addEventListener("click", () => zoom(0.8));
  byId("zoom-fit").addEventListener("click", fit);
  onChange((kinds) => {
    dirty = true;
    // Until somebody moves the map it shows all robots, also those that come later.
    if (!view.touched && kinds.has("poses") && view.fitted !== whoIsMapped()) fit();
    if (kinds.has("selection")) aim(null);
  });
  setInterval(() => (dirty = true), 1000);
  draw();
}

// Where a robot, or a point of the site, is on the page, px: for programs that drive the page.
window.fleetPage.whereIs = (id) => {
  const box = canvas.getBoundingClientRect();
  const [px, py] = toScreen(...store.poses[id]);
  return [box.left + px, box.top + py];
};
window.fleetPage.whereIsPoint = (x, y) => {
  const box = canvas.getBoundingClientRect();
  const [px, py] = toScreen(x, y);
  return [box.left + px, box.top + py];
};
