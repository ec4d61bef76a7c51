// Drawing on the map: a place, an area, a path or a fence, as YAML for fleet.yaml. It changes nothing by
// itself.

import { byId, element, show } from "./dom.js";
import { store } from "./store.js";

const KINDS = { place: "Place: a point", area: "Place: an area", path: "Path: a mission", fence: "Fence of the selected robot" };
const NEEDED = { place: 1, area: 3, path: 2, fence: 3 };
const NAME = /^[a-z][a-z0-9_-]{0,62}$/;
export const drawing = { kind: "", points: [], changed: () => {} };

const metres = (value) => String(Math.round(value * 100) / 100);
const listed = (points) => `[${points.map(([x, y]) => `[${metres(x)}, ${metres(y)}]`).join(", ")}]`;

// A fence is in its robot's own world frame; the map is in the site's frame.
function inWorld(robot, [x, y]) {
  const { origin = { x: 0, y: 0 }, yaw = 0 } = robot.placement || {};
  const [dx, dy] = [x - origin.x, y - origin.y];
  return [dx * Math.cos(yaw) + dy * Math.sin(yaw), dy * Math.cos(yaw) - dx * Math.sin(yaw)];
}

function chosen() {
  const robots = [...store.selected].map((id) => store.robots[id]).filter(Boolean);
  return robots.length === 1 ? robots[0] : null;
}

function yaml(name) {
  const { kind, points } = drawing;
  if (kind === "place") return `places:\n  ${name}: {at: [${points[0].map(metres).join(", ")}]}\n`;
  if (kind === "area") return `places:\n  ${name}: {polygon: ${listed(points)}}\n`;
  const robot = chosen();
  if (kind === "path") {
    const from = robot ? `from: ${robot.name}` : "";
    return `missions:\n  ${name}:\n    version: 1\n    roles: {mover: {${from}}}\n    steps:\n      - id: way\n        do: {mover: {path: ${listed(points)}}}\n`;
  }
  const corners = points.map((point) => inWorld(robot, point));
  return `# beside the other fields of ${robot.name}, in its own world\nfence: {inclusion: [${listed(corners)}]}\n`;
}

function trouble(name) {
  const { kind, points } = drawing;
  if (points.length < NEEDED[kind]) return `Click on the map: ${NEEDED[kind] - points.length} more ${NEEDED[kind] - points.length === 1 ? "point" : "points"}.`;
  if (kind === "fence" && !chosen()?.placement) return "Select the one robot that it is for; it has to be placed in the site's frame.";
  if (kind !== "fence" && !NAME.test(name)) return "Give it a name of small letters, digits, - and _.";
  return "";
}

function download(name) {
  const link = element("a", { href: URL.createObjectURL(new Blob([yaml(name)], { type: "application/yaml" })), download: `${name || "fence"}.yaml` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

let parts = null;
export function update() {
  if (!parts) return;
  const words = trouble(parts.name.value);
  parts.text.textContent = words || yaml(parts.name.value);
  parts.text.className = words ? "dim" : "yaml";
  parts.save.disabled = Boolean(words);
  parts.name.parentElement.hidden = drawing.kind === "fence";
  drawing.changed();
}

export function addPoint(point) {
  if (drawing.kind === "place") drawing.points = [];
  drawing.points.push(point);
  update();
}

export function closeDrawing() {
  Object.assign(drawing, { kind: "", points: [] });
  byId("drawing").hidden = true;
  parts = null;
  drawing.changed();
}

export function openDrawing() {
  if (drawing.kind) return closeDrawing();
  drawing.kind = "place";
  const kind = element("select", { "aria-label": "What to draw" }, ...Object.entries(KINDS).map(([value, words]) => element("option", { value }, words)));
  const name = element("input", { "aria-label": "Its name", placeholder: "name", autocomplete: "off" });
  const save = element("button", { type: "button", class: "primary", onclick: () => download(name.value) }, "Download YAML");
  const undo = () => { drawing.points.pop(); update(); };
  parts = { name, save, text: element("pre", {}) };
  kind.addEventListener("change", () => { Object.assign(drawing, { kind: kind.value, points: [] }); update(); });
  name.addEventListener("input", update);
  const buttons = [save, element("button", { type: "button", onclick: undo }, "Undo"), element("button", { type: "button", class: "plain", onclick: closeDrawing }, "Close")];
  const form = byId("drawing");
  form.hidden = false;
  form.onsubmit = (event) => event.preventDefault();
  show(form, kind, element("label", {}, name), parts.text, element("div", { class: "row" }, ...buttons), element("small", {}, "It takes effect through fleet.yaml only."));
  update();
}

export function paintDrawing(paint, toScreen, colors) {
  const { kind, points } = drawing;
  if (!kind || !points.length) return;
  paint.strokeStyle = paint.fillStyle = colors.place;
  paint.lineWidth = 2;
  paint.setLineDash([]);
  paint.beginPath();
  points.forEach(([x, y], number) => (number ? paint.lineTo(...toScreen(x, y)) : paint.moveTo(...toScreen(x, y))));
  if (kind === "area" || kind === "fence") paint.closePath();
  paint.stroke();
  for (const [x, y] of points) {
    paint.beginPath();
    paint.arc(...toScreen(x, y), 4, 0, 2 * Math.PI);
    paint.fill();
  }
}
