// Logout, on every page of the console with login.

import { byId } from "./dom.js";

const LOGIN = "/login.html";

async function logOut() {
  const asked = { method: "POST", headers: window.fleetPage.headers(), body: "{}" };
  const answer = await fetch("/api/logout", asked);
  if (answer.ok || answer.status === 401) location.replace(LOGIN);
}

export function startSession() {
  const button = byId("log-out");
  button.hidden = location.protocol !== "https:";
  button.addEventListener("click", () => logOut().catch(() => {})); // the page says that the console is silent
}
