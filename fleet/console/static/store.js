// The data of the console: robots, edges, poses, goals, stops, descriptions; and the WebSocket that carries
// it.

const AGAIN = 500; // ms until the WebSocket is reopened
const ANSWER_WITHIN = 6000; // ms
const PING = 1000; // ms between measurements of the round-trip time
export const SILENT = 1000; // ms without a message after which the shown data is not trusted
const TRACK = 400; // points of a track
const STEP = 0.05; // m between two points of a track

const KINDS = ["edges", "robots", "poses", "goals", "descriptions", "missions", "runs", "numbers", "photos", "schedules", "requests"];
const IN_PAST = new Set(["stop", "ping", "watch", "extent", "moment", "series"]); // what may be asked while the past is shown

// The present, whatever the page shows.
export const live = { tracks: {}, now: 0, time: 0 };
for (const kind of KINDS) live[kind] = {};

// The data that the page shows: the present, or a moment of the past.
export const store = {
  ...live,
  stops: {}, // always of the present
  past: null, // {at, recorded, events}: the shown moment, and the time of its last recorded message
  operator: "",
  permission: "view",
  version: "",
  // now: the console's monotonic seconds, in the past Unix seconds; time: Unix seconds
  heard: -Infinity, // last message, ms of this page
  roundTrip: null, // ms
  selected: new Set(),
  error: "",
};

const listeners = new Set();
const waiting = new Map(); // by request: handler of its answers
let drove = () => {};
let closed = () => {};
let socket = null;
let pinged = 0;
let number = 0;

export function onChange(call) {
  listeners.add(call);
}

// Register a handler for answers to velocities and for the end of the connection.
export function onDrove(call) {
  drove = call;
}

export function onClose(call) {
  closed = call;
}

export function changed(kinds, message) {
  for (const call of listeners) call(kinds, message);
}

function take(message) {
  store.heard = performance.now();
  if (message.type === "news") takeNews(message);
  else if (message.type === "answer") takeAnswer(message);
  else if (message.type === "pong" && message.number === number) {
    store.roundTrip = performance.now() - pinged;
  } else if (message.type === "drove") {
    drove(message);
  } else if (message.type === "hello") {
    Object.assign(store, { operator: message.operator, permission: message.permission, version: message.version });
    changed(new Set(["hello", "robots"]));
  }
}

function takeNews(message) {
  Object.assign(live, { now: message.now, time: message.time });
  if (!store.past) Object.assign(store, { now: live.now, time: live.time });
  const kinds = new Set();
  for (const kind of ["stops", ...KINDS]) {
    if (!message[kind]) continue;
    kinds.add(kind);
    const known = kind === "stops" ? store.stops : live[kind];
    for (const [id, entry] of Object.entries(message[kind])) {
      if (entry === null) delete known[id];
      else known[id] = entry;
    }
  }
  for (const [id, pose] of Object.entries(message.poses || {})) extend(id, pose);
  for (const [request, told] of Object.entries(message.stops || {})) window.fleetPage.answered(request, told);
  if (kinds.size) changed(kinds);
}

// Show a moment of the past from the console's answer; without one, the present.
export function showMoment(moment) {
  store.past = moment && { at: moment.at, recorded: moment.recorded, events: moment.events };
  for (const kind of KINDS) store[kind] = moment ? moment.entries[kind] || {} : live[kind];
  store.tracks = moment ? moment.tracks : live.tracks;
  Object.assign(store, moment ? { now: moment.at, time: moment.at } : { now: live.now, time: live.time });
  changed(new Set(["past", ...KINDS]));
}

function takeAnswer(message) {
  if (message.stop) window.fleetPage.answered(message.request, message.stop);
  const call = waiting.get(message.request);
  if (call) call(message);
  else if (message.reason) changed(new Set(["answers"]), message);
}

function extend(id, pose) {
  // A track is in one frame: it restarts when the robot is placed in the site's.
  if (live.tracks[id]?.placed !== pose[4]) live.tracks[id] = Object.assign([], { placed: pose[4] });
  const track = live.tracks[id];
  const last = track[track.length - 1];
  if (last && Math.hypot(last[0] - pose[0], last[1] - pose[1]) < STEP) return;
  track.push([pose[0], pose[1]]);
  if (track.length > TRACK) track.shift();
}

export function send(message) {
  if (!socket || socket.readyState !== WebSocket.OPEN) return false;
  if (store.past && !IN_PAST.has(message.ask)) return false;
  socket.send(JSON.stringify(message));
  return true;
}

// Send a request; ``call`` receives each answer. Returns whether it was sent.
export function ask(message, call) {
  const request = crypto.randomUUID();
  waiting.set(request, call);
  if (waiting.size > 200) waiting.delete(waiting.keys().next().value);
  return send({ request, ...message });
}

// Without a session nothing can be shown or requested, not even a stop: the login page says so.
function toLogin(address) {
  location.replace(address + location.hash);
}

// Why no connection opens: a restarted console has no sessions.
async function tellWhy() {
  try {
    const asked = { headers: window.fleetPage.headers(), signal: AbortSignal.timeout(ANSWER_WITHIN) };
    const answer = await fetch("/api/session", asked);
    const told = await answer.json();
    if (told.login) toLogin(told.login);
    store.error = answer.ok ? "" : told.error;
  } catch {
    store.error = "";
  }
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/ws`, ["fleet.console", window.fleetPage.proof() || "none"]);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  let opened = false;
  socket.onopen = () => {
    opened = true;
    store.error = "";
    changed(new Set(["open"]));
  };
  socket.onclose = async () => {
    closed();
    if (!opened) await tellWhy();
    setTimeout(connect, AGAIN);
  };
}

export async function start() {
  window.fleetPage.sendBySocket = send;
  window.fleetPage.selected = () => [...store.selected];
  try {
    await window.fleetPage.session;
  } catch (error) {
    if (error.login) toLogin(error.login);
    store.error = error.message;
    changed(new Set(["error"]));
    return;
  }
  connect();
  setInterval(() => {
    pinged = performance.now();
    number += 1;
    send({ ask: "ping", number });
  }, PING);
}

export function silentFor() {
  return performance.now() - store.heard;
}

export function select(ids, { add = false } = {}) {
  if (!add) store.selected.clear();
  for (const id of ids) {
    if (add && store.selected.has(id)) store.selected.delete(id);
    else store.selected.add(id);
  }
  changed(new Set(["selection"]));
}

// Robots, worst first, then by name with numbers in natural order.
const WORST = { fault: 0, degraded: 1, offline: 2, ok: 3 };
export function ordered() {
  return Object.values(store.robots).sort(
    (one, other) =>
      (WORST[one.health] ?? 0) - (WORST[other.health] ?? 0) ||
      other.emergency_stop - one.emergency_stop ||
      one.id.localeCompare(other.id, undefined, { numeric: true }),
  );
}

// Why the data of a robot is outdated, empty if it is not.
export function staleness(robot, among = store) {
  const edge = among.edges[robot.edge];
  if (edge && !edge.alive) return `edge ${robot.edge}: ${edge.problem || "away"}`;
  const old = among.now - robot.heard;
  return old > 3 ? `it has reported nothing for ${Math.round(old)} s` : "";
}

// The robots on the map: those in the site's frame, or, if there are none, each in its own frame.
export function mapped() {
  const there = Object.values(store.robots).filter((robot) => store.poses[robot.id]);
  const placed = there.filter((robot) => store.poses[robot.id][4]);
  return placed.length ? placed : there;
}

export function label(robot) {
  const same = Object.values(store.robots).filter((other) => other.name === robot.name);
  return same.length > 1 ? robot.id : robot.name;
}
