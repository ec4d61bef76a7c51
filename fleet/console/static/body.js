// A robot in 3D, from the parts of its body and the reported joints, now or at a moment of the past. Drawn on
// a plain canvas; x forward, y left, z up, metres.

import { element } from "./dom.js";
import { onChange, store } from "./store.js";

const HEIGHT = 220; // px
const TURN = 0.1; // rad per key press
const view = { yaw: 0.7, pitch: 0.35 }; // direction of view, rad; the same for every robot
let canvas = null;
let told = null; // the text under the drawing
let shown = ""; // the robot
let dirty = false;

// -- rotation: a frame is a point and three axes (the columns of its rotation) ----------------------------------

const add = ([a, b, c], [d, e, f]) => [a + d, b + e, c + f];
const apply = (axes, [x, y, z]) => [0, 1, 2].map((row) => axes[0][row] * x + axes[1][row] * y + axes[2][row] * z);
const into = (frame, point) => add(frame.at, apply(frame.axes, point));
const vector = (given) => [given?.x || 0, given?.y || 0, given?.z || 0];
const UPRIGHT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

// The rotation by an angle about an axis (Rodrigues).
function about([x, y, z], angle) {
  const length = Math.hypot(x, y, z) || 1;
  const [u, v, w] = [x / length, y / length, z / length];
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const k = 1 - c;
  return [[c + u * u * k, v * u * k + w * s, w * u * k - v * s], [u * v * k - w * s, c + v * v * k, w * v * k + u * s], [u * w * k + v * s, v * w * k - u * s, c + w * w * k]];
}

// Attitude of the robot without its heading, which the map shows.
function leaning(numbers) {
  const [qx, qy, qz, qw] = ["qx", "qy", "qz", "qw"].map((name) => numbers[`position.${name}`]);
  if ([qx, qy, qz, qw].some((value) => value === undefined)) return UPRIGHT;
  const roll = Math.atan2(2 * (qw * qx + qy * qz), 1 - 2 * (qx * qx + qy * qy));
  const pitch = Math.asin(Math.max(-1, Math.min(1, 2 * (qw * qy - qz * qx))));
  const [rolled, pitched] = [about([1, 0, 0], roll), about([0, 1, 0], pitch)];
  return rolled.map((axis) => apply(pitched, axis));
}

// The frame of each part, by its name; a joint without a report is at zero.
export function framesOf(parts, numbers) {
  const frames = { "": { at: [0, 0, 0], axes: leaning(numbers) } };
  for (const part of parts) {
    const parent = frames[part.parent || ""];
    if (!parent) continue; // its parent must come before it
    const angle = part.joint ? numbers[`joint_states.positions.${part.joint}`] || 0 : 0;
    const turned = angle ? about(vector(part.axis), angle) : UPRIGHT;
    frames[part.name] = { at: into(parent, vector(part.at)), axes: turned.map((axis) => apply(parent.axes, axis)) };
  }
  return frames;
}

// -- drawing -----------------------------------------------------------------------------------------------------

const FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];

function shapesOf(parts, frames) {
  const shapes = [];
  for (const part of parts) {
    const frame = frames[part.name];
    if (!frame) continue;
    if (part.end) shapes.push({ points: [frame.at, into(frame, vector(part.end))], side: frame.at[1] });
    if (!part.size) continue;
    const [x, y, z] = vector(part.size).map((side) => side / 2);
    const corners = [-x, x].flatMap((a) => [-y, y].flatMap((b) => [-z, z].map((c) => into(frame, [a, b, c]))));
    for (const face of FACES) shapes.push({ points: face.map((number) => corners[number]), face: true });
  }
  return shapes;
}

function projector(points, width) {
  const middle = [0, 1, 2].map((axis) => (Math.min(...points.map((point) => point[axis])) + Math.max(...points.map((point) => point[axis]))) / 2);
  const reach = Math.max(0.1, ...points.map((point) => Math.hypot(...point.map((value, axis) => value - middle[axis]))));
  const scale = (0.46 * Math.min(width, HEIGHT)) / reach;
  const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
  return (point) => {
    const [x, y, z] = point.map((value, axis) => value - middle[axis]);
    const [ahead, aside] = [x * cy + y * sy, -x * sy + y * cy];
    // the last value: depth
    return [width / 2 + aside * scale, HEIGHT / 2 - (z * cp - ahead * sp) * scale, ahead * cp + z * sp];
  };
}

function drawGround(paint, project, lowest, color) {
  paint.strokeStyle = color("--line-strong");
  paint.lineWidth = 1;
  for (let step = -4; step <= 4; step += 1) {
    const at = step * 0.1;
    for (const ends of [[[at, -0.4, lowest], [at, 0.4, lowest]], [[-0.4, at, lowest], [0.4, at, lowest]]]) {
      paint.beginPath();
      paint.moveTo(...project(ends[0]).slice(0, 2));
      paint.lineTo(...project(ends[1]).slice(0, 2));
      paint.stroke();
    }
  }
}

function drawShape(paint, project, { points, face, side }, color) {
  const seen = points.map(project);
  paint.beginPath();
  seen.forEach(([x, y], number) => (number ? paint.lineTo(x, y) : paint.moveTo(x, y)));
  paint.lineJoin = paint.lineCap = "round";
  if (face) {
    paint.closePath();
    paint.fillStyle = color("--paper");
    paint.strokeStyle = color("--ink");
    paint.lineWidth = 1;
    paint.fill();
    paint.stroke();
    return;
  }
  paint.strokeStyle = side > 0 ? color("--accent") : color("--place"); // left and right
  paint.lineWidth = 6;
  paint.stroke();
}

function draw() {
  requestAnimationFrame(draw);
  if (!dirty || !canvas?.isConnected) return;
  dirty = false;
  const parts = store.descriptions[shown]?.body || [];
  const numbers = store.numbers[shown] || {};
  const width = canvas.clientWidth || 280;
  const ratio = devicePixelRatio || 1;
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(HEIGHT * ratio) });
  const paint = canvas.getContext("2d");
  paint.scale(ratio, ratio);
  const style = getComputedStyle(document.body);
  const color = (name) => style.getPropertyValue(name).trim();
  const shapes = shapesOf(parts, framesOf(parts, numbers));
  const points = shapes.flatMap((shape) => shape.points);
  const project = projector(points, width);
  drawGround(paint, project, Math.min(...points.map((point) => point[2])), color);
  const near = (shape) => Math.max(...shape.points.map((point) => project(point)[2]));
  for (const shape of shapes.sort((one, other) => near(one) - near(other))) drawShape(paint, project, shape, color);
  tell(parts, numbers);
}

function tell(parts, numbers) {
  const joints = parts.filter((part) => part.joint);
  const missing = joints.filter((part) => numbers[`joint_states.positions.${part.joint}`] === undefined);
  const some = missing.length < joints.length ? `${missing.length} joints are` : "No joint is";
  const text = missing.length ? `${some} reported; shown at zero.` : "";
  if (told.textContent !== text) told.textContent = text;
}

// -- input -------------------------------------------------------------------------------------------------------

const KEYS = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, TURN], ArrowDown: [0, -TURN] };

function turn(yaw, pitch) {
  view.yaw += yaw;
  view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + pitch));
  dirty = true;
}

function made(robot) {
  const drawing = element("canvas", { class: "body3d", tabindex: "0", role: "img", "aria-label": `${robot.name} in 3D, as its joints are. Arrow keys turn it.` });
  drawing.addEventListener("pointerdown", (event) => drawing.setPointerCapture(event.pointerId));
  drawing.addEventListener("pointermove", (event) => event.buttons && turn(-event.movementX / 100, event.movementY / 100));
  drawing.addEventListener("keydown", (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    turn(...KEYS[event.key]);
  });
  return drawing;
}

export const bodyKey = (robot) => [robot.id, store.descriptions[robot.id].body];

export function bodyOf(robot) {
  shown = robot.id;
  canvas = made(robot);
  told = element("small", { class: "dim" });
  dirty = true;
  return [element("h3", {}, "Body"), canvas, told];
}

export function startBody() {
  onChange((kinds) => {
    if (["numbers", "past", "descriptions"].some((kind) => kinds.has(kind))) dirty = true;
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => (dirty = true));
  draw();
}

// For programs that drive the page: the ends of the parts of the shown robot.
window.fleetPage.partEnds = () => {
  const parts = store.descriptions[shown]?.body || [];
  const frames = framesOf(parts, store.numbers[shown] || {});
  return Object.fromEntries(parts.filter((part) => part.end).map((part) => [part.name, into(frames[part.name], vector(part.end))]));
};
