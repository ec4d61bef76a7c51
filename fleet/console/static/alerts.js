// Sound and browser notification when a robot gets a fault or is lost, if the user enables them.

import { byId } from "./dom.js";
import { label, live, onChange, SILENT, silentFor, staleness } from "./store.js";

const KEPT = "fleet-alerts"; // in the storage of the page's origin
const QUIET = 3000; // ms between sounds
const TONE = [880, 0.12, 0.3]; // Hz, share of full volume, s
let wanted = localStorage.getItem(KEPT) === "on";
let known = null; // health by robot; null before the first update
let silent = false;
let sounded = -Infinity;
let audio = null;

function sound() {
  if (performance.now() - sounded < QUIET) return;
  sounded = performance.now();
  audio ??= new AudioContext();
  const [pitch, volume, seconds] = TONE;
  const [tone, gain] = [audio.createOscillator(), audio.createGain()];
  tone.frequency.value = pitch;
  gain.gain.value = volume;
  tone.connect(gain).connect(audio.destination);
  tone.start();
  tone.stop(audio.currentTime + seconds);
}

function alert(title, body, tag) {
  if (!wanted) return;
  sound();
  if (Notification.permission === "granted") new Notification(title, { body, tag });
}

const how = (robot) => (staleness(robot, live) || robot.health === "offline" ? "lost" : robot.health === "fault" ? "fault" : "");

function look() {
  const now = Object.fromEntries(Object.values(live.robots).map((robot) => [robot.id, how(robot)]));
  for (const [id, found] of Object.entries(known ? now : {})) {
    const robot = live.robots[id];
    if (found && id in known && known[id] !== found) alert(`${label(robot)}: ${found === "lost" ? "lost" : "fault"}`, staleness(robot, live) || robot.cause || "", id);
  }
  if (Object.keys(now).length) known = now;
  const is = known !== null && silentFor() > SILENT;
  if (is && !silent) alert("The console is silent", "What the page shows is old.", "console");
  silent = is;
}

function show() {
  const button = byId("alerts");
  button.setAttribute("aria-pressed", String(wanted));
  button.textContent = wanted ? "Alerts on" : "Alerts off";
}

async function toggle() {
  wanted = !wanted;
  localStorage.setItem(KEPT, wanted ? "on" : "off");
  show();
  if (!wanted) return;
  sound();
  if (Notification.permission === "default") await Notification.requestPermission();
}

export function startAlerts() {
  byId("alerts").addEventListener("click", toggle);
  show();
  onChange((kinds) => {
    if (kinds.has("robots") || kinds.has("edges")) look();
  });
  setInterval(look, 1000);
}
