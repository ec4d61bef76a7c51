// Input on the map: select and send robots, move the view, draw points.

import { geoOf, loadBasemap } from "./basemap.js";
import { byId, counted, element, show } from "./dom.js";
import { order } from "./answers.js";
import { addPoint, closeDrawing, drawing, openDrawing, update } from "./draw.js";
import { paintMap } from "./mappaint.js";
import { canvas, fit, map, readColors, resize, size, toScreen, toSite, view, whoIsMapped, zoom } from "./mapview.js";
import { label, mapped, onChange, select, store } from "./store.js";

const GRIP = 14; // px around a robot that select it
const DRAG = 5; // px of movement before a press becomes a drag
const pointers = new Map();

// -- input -----------------------------------------------------------------------------------------------

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
  map.drag = pointers.size === 1 ? { wanted: kind, kind: "", from: place(event), to: place(event), last: place(event) } : { kind: "pinch" };
}

function moved(event) {
  if (!pointers.has(event.pointerId) || !map.drag) return;
  const before = pinch();
  pointers.set(event.pointerId, place(event));
  if (map.drag.kind === "pinch") {
    const after = pinch();
    if (before && after) zoom(after.apart / before.apart, ...after.middle);
    return;
  }
  map.drag.to = place(event);
  if (!map.drag.kind && Math.hypot(map.drag.to[0] - map.drag.from[0], map.drag.to[1] - map.drag.from[1]) > DRAG) map.drag.kind = map.drag.wanted;
  if (map.drag.kind === "pan") {
    view.touched = true;
    view.x -= (map.drag.to[0] - map.drag.last[0]) / view.scale;
    view.y += (map.drag.to[1] - map.drag.last[1]) / view.scale;
    placeTarget();
  }
  map.drag.last = map.drag.to;
  map.dirty = true;
}

function pinch() {
  if (pointers.size !== 2) return null;
  const [one, other] = [...pointers.values()];
  return { apart: Math.max(1, Math.hypot(one[0] - other[0], one[1] - other[1])), middle: [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2] };
}

function up(event) {
  if (!pointers.delete(event.pointerId) || !map.drag) return;
  const was = map.drag;
  if (!pointers.size) map.drag = null;
  map.dirty = true;
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
  if (drawing.kind) return addPoint(toSite(...place(event)));
  const robot = robotAt(place(event));
  if (robot) {
    aim(null);
    select([robot], { add: event.shiftKey || event.ctrlKey || event.metaKey });
  } else if (store.selected.size && !map.target && !store.past) aim(toSite(...place(event)));
  else aim(null);
}

function turn() {
  requestAnimationFrame(turn);
  if (!map.dirty) return;
  map.dirty = false;
  paintMap();
}

// -- goals of the selected robots --------------------------------------------------------------------------

function aim(point) {
  map.target = point ? { x: point[0], y: point[1] } : null;
  map.dirty = true;
  const form = byId("target");
  form.hidden = !map.target;
  if (!map.target) return;
  const robots = [...store.selected].map((id) => store.robots[id]).filter(Boolean);
  const whom = robots.length === 1 ? label(robots[0]) : counted(robots.length, "robot");
  const go = element("button", { class: "primary", disabled: store.permission === "view" }, "Go");
  const spread = robots.length > 1 ? element("label", {}, element("span", {}, "apart"), element("input", { name: "spacing", type: "number", min: "0.5", step: "0.5", value: "2" }), element("small", {}, "m")) : null;
  const words = `Send ${whom} to ${map.target.x.toFixed(1)}, ${map.target.y.toFixed(1)}`;
  const geo = geoOf(map.target.x, map.target.y);
  const onEarth = geo ? element("small", {}, geo.map((each) => each.toFixed(6)).join(", ")) : null;
  show(form, element("p", {}, words), onEarth, spread, element("div", { class: "row" }, go, element("button", { type: "button", class: "plain", onclick: () => aim(null) }, "Cancel")));
  form.onsubmit = (event) => {
    event.preventDefault();
    const asked = { ask: "goto", robots: robots.map((robot) => robot.id), x: map.target.x, y: map.target.y };
    if (spread) asked.spacing = Number(form.elements.spacing.value) || 2;
    order(asked, `${whom} to ${map.target.x.toFixed(1)}, ${map.target.y.toFixed(1)}`);
    aim(null);
    canvas.focus();
  };
  placeTarget();
  go.focus({ preventScroll: true });
}

function placeTarget() {
  if (!map.target) return;
  const form = byId("target");
  const [px, py] = toScreen(map.target.x, map.target.y);
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
    map.dirty = true;
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
    map.dirty = true;
  });
  byId("target").addEventListener("keydown", (event) => event.key === "Escape" && aim(null));
  byId("zoom-in").addEventListener("click", () => zoom(1.25));
  byId("zoom-out").addEventListener("click", () => zoom(0.8));
  byId("draw").addEventListener("click", openDrawing);
  drawing.changed = () => (map.dirty = true);
  byId("zoom-fit").addEventListener("click", fit);
  onChange((kinds) => {
    map.dirty = true;
    // Until the user moves the map, it shows all robots, also new ones.
    if (!view.touched && kinds.has("poses") && view.fitted !== whoIsMapped()) fit();
    if (kinds.has("selection") || kinds.has("past")) {
      aim(null);
      update();
    }
    if (kinds.has("past")) {
      if (store.past) closeDrawing();
      byId("draw").hidden = Boolean(store.past);
    }
  });
  setInterval(() => (map.dirty = true), 1000);
  window.fleetPage.session.then(loadBasemap).catch(() => {}); // without a session the page shows the reason itself
  turn();
}

// Position of a robot or a point of the site on the page, px: for programs that drive the page.
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
