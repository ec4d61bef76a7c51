// Paints the map: grid, places, fences, tracks, goals, robots.

import { paintBasemap } from "./basemap.js";
import { byId, counted } from "./dom.js";
import { paintDrawing } from "./draw.js";
import { colors, map, paint, size, toScreen, toSite, view } from "./mapview.js";
import { ghosts } from "./rehearsal.js";
import { label, mapped, staleness, store } from "./store.js";

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
  const place = x !== null ? [at + 3, size.height - 6] : [4, at - 3];
  paint.lineWidth = 3;
  paint.strokeStyle = colors.paper; // outline of the text, which may be on a map
  paint.strokeText(text, ...place);
  paint.lineWidth = 1;
  paint.fillText(text, ...place);
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

// A fence is in its robot's own world frame; the robot's state places it in the site's frame.
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
  // A simulated robot is outlined; a real one is filled.
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

// The robots of a rehearsal: hollow, dotted and labelled as ghosts, so that none looks like a robot.
function drawGhost({ name, way, place }) {
  const [px, py] = toScreen(place[0], place[1]);
  paint.save();
  paint.strokeStyle = paint.fillStyle = colors.place;
  paint.lineWidth = 1.5;
  paint.setLineDash([1, 4]);
  paint.beginPath();
  way.forEach(([, x, y], number) => (number ? paint.lineTo(...toScreen(x, y)) : paint.moveTo(...toScreen(x, y))));
  paint.stroke();
  paint.setLineDash([2, 2]);
  if (place[3] === null) {
    paint.beginPath();
    paint.arc(px, py, 9, 0, 2 * Math.PI);
  } else arrow(px, py, place[3], 16);
  paint.globalAlpha = 0.25;
  paint.fill();
  paint.globalAlpha = 1;
  paint.stroke();
  paint.font = "italic 12px system-ui, sans-serif";
  paint.textAlign = "center";
  paint.fillText(Math.abs(place[2]) > 0.5 ? `ghost of ${name} · ${place[2].toFixed(1)} m up` : `ghost of ${name}`, px, py - 22);
  paint.restore();
}

function drawBox() {
  const { drag } = map;
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

// Covers the whole map, so that a picture of the past never looks like the present.
function drawPast() {
  paint.save();
  paint.fillStyle = colors.past;
  paint.globalAlpha = 0.16;
  paint.font = "700 44px system-ui, sans-serif";
  paint.textAlign = "center";
  for (let y = 60; y < size.height; y += 130) for (let x = 90; x < size.width + 90; x += 230) paint.fillText("PAST", x + (y % 260 ? 60 : 0), y);
  paint.restore();
}

// Paint the whole map.
export function paintMap() {
  paint.clearRect(0, 0, size.width, size.height);
  paintBasemap();
  if (store.past) drawPast();
  drawGrid();
  drawPlaces();
  drawFences();
  const there = mapped();
  tellFrame(there);
  for (const robot of there) drawTrack(robot.id);
  for (const robot of there) drawGoal(robot.id);
  for (const robot of there) drawRobot(robot);
  for (const ghost of ghosts()) drawGhost(ghost);
  if (map.target) {
    paint.strokeStyle = colors.accent;
    paint.lineWidth = 2.5;
    cross([map.target.x, map.target.y], 9);
  }
  paintDrawing(paint, toScreen, colors);
  drawBox();
}
