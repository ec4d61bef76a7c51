// The newest picture of the selected robot, loaded when the console announces it.

import { element, timeOfDay } from "./dom.js";
import { store } from "./store.js";

let loaded = { robot: "", stamp: 0, address: "" };

// As a data address: an <img> cannot send the proof of the session.
async function load(robot, { stamp }, picture) {
  const answer = await fetch(`/api/photos/${robot.id.split("/").map(encodeURIComponent).join("/")}`, { headers: window.fleetPage.headers() });
  if (!answer.ok) return;
  const reader = new FileReader();
  reader.onload = () => {
    loaded = { robot: robot.id, stamp, address: reader.result };
    picture.src = reader.result;
  };
  reader.readAsDataURL(await answer.blob());
}

export const photoKey = (robot) => [robot.id, store.photos[robot.id]];

export function photoOf(robot) {
  const told = store.photos[robot.id];
  const picture = element("img", { class: "photo", alt: `What the camera of ${robot.name} saw at ${timeOfDay(told.stamp)}`, width: told.width, height: told.height });
  if (loaded.robot === robot.id) picture.src = loaded.address; // until the newer one is loaded
  if (loaded.robot !== robot.id || loaded.stamp !== told.stamp) load(robot, told, picture);
  return [element("h3", {}, "Picture"), picture, element("small", { class: "dim" }, `taken ${timeOfDay(told.stamp)}; take_photo takes another`)];
}
