// The part of the site on the map: x is east, y is north, metres; and the colours of the map.

import { byId } from "./dom.js";
import { ghosts } from "./rehearsal.js";
import { mapped, store } from "./store.js";

const LEAST = 0.5; // px per metre
const MOST = 400;
export const canvas = byId("map");
export const paint = canvas.getContext("2d");
export const view = { x: 0, y: 0, scale: 30, fitted: "", touched: false }; // fitted: to which robots
export const size = { width: 0, height: 0 };
export const colors = {};
export const map = { dirty: true, drag: null, target: null }; // target: {x, y}: where robots may be sent

export const toScreen = (x, y) => [size.width / 2 + (x - view.x) * view.scale, size.height / 2 - (y - view.y) * view.scale];
export const toSite = (px, py) => [view.x + (px - size.width / 2) / view.scale, view.y - (py - size.height / 2) / view.scale];

export function readColors() {
  const style = getComputedStyle(document.documentElement);
  const names = ["ink", "dim", "line", "line-strong", "ok", "degraded", "fault", "offline", "accent", "paper", "track", "place", "past"];
  for (const name of names) colors[name] = style.getPropertyValue(`--${name}`).trim();
}

export function resize() {
  const box = canvas.parentElement.getBoundingClientRect();
  const ratio = devicePixelRatio || 1;
  Object.assign(size, { width: box.width, height: box.height });
  canvas.width = Math.round(box.width * ratio);
  canvas.height = Math.round(box.height * ratio);
  paint.setTransform(ratio, 0, 0, ratio, 0, 0);
  if (!view.touched) fit();
  map.dirty = true;
}

export const whoIsMapped = () => mapped().map((robot) => robot.id).join();

export function fit() {
  const points = mapped().map((robot) => store.poses[robot.id].slice(0, 2));
  for (const way of Object.values(store.goals)) points.push(...way.map((point) => [point[0], point[1]]));
  for (const { way } of ghosts()) points.push(...way.map((point) => [point[1], point[2]]));
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
  map.dirty = true;
}

export function zoom(factor, px = size.width / 2, py = size.height / 2) {
  view.touched = true;
  const [x, y] = toSite(px, py);
  view.scale = Math.min(MOST, Math.max(LEAST, view.scale * factor));
  const [nx, ny] = toSite(px, py);
  view.x += x - nx;
  view.y += y - ny;
  map.dirty = true;
}
