// Live video of the selected robot, from a program on the site (fleet video) directly to this page (WebRTC).

import { order } from "./answers.js";
import { element } from "./dom.js";
import { ask, changed, label } from "./store.js";

const GATHERED_WITHIN = 1000; // ms for this computer's own addresses
let live = null; // {robot, words, peer, screen}

function tell(words) {
  if (live) live.words = words;
  changed(new Set(["video"]));
}

// End the video; the program notices the loss of its viewer.
export function endVideo() {
  live?.peer?.close();
  live = null;
}

// Candidates are sent with the answer: a console forwards one message, not one per candidate.
function gathered(peer) {
  return new Promise((resolve) => {
    const done = () => peer.iceGatheringState === "complete" && resolve();
    peer.addEventListener("icegatheringstatechange", done);
    setTimeout(resolve, GATHERED_WITHIN);
    done();
  });
}

async function answer(mine, { sdp, sensor }) {
  const peer = new RTCPeerConnection();
  mine.peer = peer;
  peer.addEventListener("track", (event) => {
    mine.screen.srcObject = new MediaStream([event.track]);
    mine.screen.play().catch(() => {});
  });
  peer.addEventListener("connectionstatechange", () => {
    if (live !== mine) return;
    if (peer.connectionState === "connected") tell("");
    else if (["failed", "disconnected", "closed"].includes(peer.connectionState)) {
      endVideo();
      tell("");
    }
  });
  await peer.setRemoteDescription({ type: "offer", sdp });
  await peer.setLocalDescription(await peer.createAnswer());
  await gathered(peer);
  if (live !== mine) return;
  ask({ ask: "video_answer", robot: mine.robot, sensor, sdp: peer.localDescription.sdp }, refused(mine));
}

const refused = (mine) => (told) => {
  if (told.status === "accepted" || live !== mine) return;
  mine.peer?.close();
  mine.peer = null;
  tell(`${told.reason}${told.hint ? ` (${told.hint})` : ""}`);
};

function begin(robot) {
  endVideo();
  const screen = element("video", { muted: true, autoplay: true, playsinline: true, class: "photo", "aria-label": `Live video of ${label(robot)}` });
  screen.muted = true;
  const mine = (live = { robot: robot.id, words: "asking for the video…", peer: null, screen });
  const no = refused(mine);
  // Wait for the offer before requesting it from the program.
  ask({ ask: "video", robot: robot.id }, (told) => {
    if (live !== mine || mine.failed) return;
    if (told.offer) answer(mine, told.offer).catch((error) => no({ status: "failed", reason: error.message }));
    else no(told);
  });
  const asked = { ask: "command", robot: robot.id, command: "start_video", data: { viewer: "local", recording: false } };
  order(asked, `${label(robot)}: live video`, (told) => {
    if (told.status === "accepted" && told.done !== false) return;
    mine.failed = true;
    no({ ...told, status: "failed" });
  });
  changed(new Set(["video"]));
}

export const videoKey = (robot) => [robot.id, live?.robot, live?.words, Boolean(live?.peer)];

// The part of the panel; a playing video keeps its element.
export function videoOf(robot) {
  const head = element("h3", {}, "Live video");
  if (live?.robot !== robot.id) return [head, element("button", { type: "button", class: "plain", onclick: () => begin(robot) }, "Show live video")];
  const end = () => {
    endVideo();
    changed(new Set(["video"]));
  };
  const words = live.words ? element("p", { class: "dim", role: "status" }, live.words) : null;
  return [head, live.peer ? live.screen : null, words, element("button", { type: "button", class: "plain", onclick: end }, "End live video")];
}
