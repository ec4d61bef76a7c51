// The map under the robots: tiles from an archive on the console's computer, placed by the site's origin.
// Latitudes and longitudes are in degrees, the site's x (east) and y (north) in metres.

import { byId } from "./dom.js";
import { map, paint, size, toScreen, toSite, view } from "./mapview.js";

const RADIUS = 6378137; // m, WGS 84
const FLATTENED = 0.00669437999014; // first eccentricity squared, WGS 84
const PIXELS = 256; // width and height of a tile
const MOST_SHOWN = 400; // tiles; a view that needs more shows none
const MOST_KEPT = 600;
const AGAIN = 5000; // ms until a failed tile is requested again
const CORRECTIONS = 3; // iterations of the inverse, which has no closed form
const rad = Math.PI / 180;

let site = null; // {origin, zooms, attribution}
let shown = true;
const pictures = new Map(); // by address: a bitmap, or null while it is loading or if there is none

const fromAxis = (sin, cos) => {
  const across = RADIUS / Math.sqrt(1 - FLATTENED * sin * sin);
  return [(across + site.origin[2]) * cos, (across * (1 - FLATTENED) + site.origin[2]) * sin];
};

// A point on Earth in the tangent plane of the origin (fleet/model/geodesy.py).
export function siteOf(latitude, longitude) {
  const [sinHere, cosHere] = [Math.sin(site.origin[0] * rad), Math.cos(site.origin[0] * rad)];
  const turn = (((longitude - site.origin[1] + 540) % 360) - 180) * rad;
  const [axisHere, equatorHere] = fromAxis(sinHere, cosHere);
  const [axis, equator] = fromAxis(Math.sin(latitude * rad), Math.cos(latitude * rad));
  const outward = axis * Math.cos(turn) - axisHere;
  return [axis * Math.sin(turn), cosHere * (equator - equatorHere) - sinHere * outward];
}

// The latitude and longitude of a point of the site; null if the site has no origin.
export function geoOf(x, y) {
  if (!site) return null;
  let [latitude, longitude] = site.origin;
  const parallel = RADIUS * Math.cos(latitude * rad);
  for (let again = 0; again < CORRECTIONS; again += 1) {
    const [east, north] = siteOf(latitude, longitude);
    latitude += (y - north) / RADIUS / rad;
    longitude += (x - east) / parallel / rad;
  }
  return [latitude, longitude];
}

// Web Mercator in tiles of a zoom: column and row, with fractions.
const mercator = ([latitude, longitude], zoom) => [
  ((longitude + 180) / 360) * 2 ** zoom,
  ((1 - Math.asinh(Math.tan(latitude * rad)) / Math.PI) / 2) * 2 ** zoom,
];

function screenOf(column, row, zoom) {
  const latitude = Math.atan(Math.sinh(Math.PI * (1 - (2 * row) / 2 ** zoom))) / rad;
  return toScreen(...siteOf(latitude, (column / 2 ** zoom) * 360 - 180));
}

// The zoom whose tiles match the resolution of the screen.
function zoomShown() {
  const metres = (2 * Math.PI * RADIUS * Math.cos(site.origin[0] * rad)) / PIXELS;
  const wanted = Math.round(Math.log2(metres * view.scale * (devicePixelRatio || 1)));
  return Math.min(site.zooms[1], Math.max(site.zooms[0], wanted));
}

async function fetchPicture(address) {
  const answer = await fetch(address, { headers: window.fleetPage.headers() });
  if (answer.status === 204) return; // there is none
  if (answer.status !== 200) throw new Error(answer.statusText);
  pictures.set(address, await createImageBitmap(await answer.blob()));
  map.dirty = true;
}

function pictureAt(address) {
  if (!pictures.has(address)) {
    pictures.set(address, null);
    if (pictures.size > MOST_KEPT) pictures.delete(pictures.keys().next().value);
    fetchPicture(address).catch(() => setTimeout(() => pictures.delete(address), AGAIN));
  }
  return pictures.get(address);
}

// Paint the tiles of the visible area, below everything else.
export function paintBasemap() {
  if (!site?.zooms || !shown) return;
  const zoom = zoomShown();
  const [west, north] = mercator(geoOf(...toSite(0, 0)), zoom).map(Math.floor);
  const [east, south] = mercator(geoOf(...toSite(size.width, size.height)), zoom).map(Math.floor);
  if ((east - west + 1) * (south - north + 1) > MOST_SHOWN) return;
  paint.globalAlpha = 0.85; // so that robots and lines stand out
  for (let column = west; column <= east; column += 1) {
    for (let row = north; row <= south; row += 1) {
      const picture = pictureAt(`/api/tiles/${zoom}/${column}/${row}`);
      if (!picture) continue;
      const [left, top] = screenOf(column, row, zoom).map(Math.round);
      const [right, bottom] = screenOf(column + 1, row + 1, zoom).map(Math.round);
      paint.drawImage(picture, left, top, right - left, bottom - top);
    }
  }
  paint.globalAlpha = 1;
}

// Request the map from the console, after sign-in.
export async function loadBasemap() {
  const answer = await fetch("/api/basemap", { headers: window.fleetPage.headers() });
  const told = answer.ok ? await answer.json() : {};
  if (!told.origin) return;
  site = told;
  const button = byId("basemap");
  button.hidden = !site.zooms;
  button.addEventListener("click", () => {
    shown = !shown;
    button.setAttribute("aria-pressed", String(shown));
    byId("map-credit").hidden = !shown;
    map.dirty = true;
  });
  byId("map-credit").textContent = site.attribution || "";
  map.dirty = true;
}

// Number of loaded tiles, and conversion from Earth to the site: for programs that drive the page.
window.fleetPage.basemap = {
  loaded: () => [...pictures.values()].filter(Boolean).length,
  siteOf: (latitude, longitude) => site && siteOf(latitude, longitude),
  geoOf,
};
