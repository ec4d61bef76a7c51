// The stop, and the session that it needs. A plain script that runs before the rest of the page is loaded, so
// that a stop works during loading. It is sent over the WebSocket if that is open, and by POST if it is not,
// or does not answer. Nothing is shown as accepted without an answer of the console.
"use strict";
(() => {
  const TWICE = 700; // ms between two presses of Esc
  const SECOND_WAY = 250; // ms without an answer after which the second route is used too
  const AGAIN = 500; // ms between tries
  const POST_WITHIN = 6000; // ms
  const page = (window.fleetPage = {
    stops: new Map(), // by request: {robots, began, answered, told, tries, error}
    sendBySocket: () => false, // replaced when the WebSocket is ready
    selected: () => [],
    changed: () => {}, // replaced by the view of stops
    endPads: () => {},
  });

  // The proof is stored for this port only; a cookie is sent to every port of a computer.
  let proof = "";
  try {
    proof = localStorage.getItem("proof") || "";
  } catch {
    // storage is disabled: the session ends with this page
  }
  page.proof = () => proof;
  page.headers = () => ({ "Content-Type": "application/json", "X-Fleet-Proof": proof });

  function keep(told) {
    proof = told.proof;
    try {
      localStorage.setItem("proof", proof);
    } catch {
      // as above
    }
    return told;
  }

  const soon = () => AbortSignal.timeout(POST_WITHIN);
  const pause = (time) => new Promise((resume) => setTimeout(resume, time));

  // The token of the link, removed from the address; what is left there is a moment of the past.
  function takeToken() {
    const given = new URLSearchParams(location.hash.slice(1));
    const token = given.get("token");
    if (!token) return "";
    given.delete("token");
    history.replaceState(null, "", location.pathname + (given.size ? `#${given}` : ""));
    return token;
  }

  const token = takeToken();
  const self = crypto.randomUUID(); // so that a repeated request of this page is accepted

  async function openSession() {
    let refusal = null;
    if (token) {
      const body = JSON.stringify({ token, page: self });
      const answer = await fetch("/api/session", { method: "POST", headers: page.headers(), body, signal: soon() });
      if (answer.ok) return keep(await answer.json());
      refusal = await answer.json();
    }
    const answer = await fetch("/api/session", { headers: page.headers(), signal: soon() });
    const told = await answer.json();
    if (answer.ok) return told;
    throw Object.assign(new Error((refusal || told).error), { login: told.login, refused: true });
  }

  // Without a session the page can stop nothing: repeat the request until the console answers.
  async function insistOnSession() {
    for (;;) {
      try {
        return await openSession();
      } catch (error) {
        if (error.refused) throw error;
        await pause(AGAIN);
      }
    }
  }
  page.session = insistOnSession();
  page.session.catch(() => {});

  async function post(request, stop) {
    await Promise.race([page.session.catch(() => {}), pause(POST_WITHIN)]);
    const body = JSON.stringify({ ask: "stop", request, robots: stop.robots });
    const answer = await fetch("/api/stop", { method: "POST", headers: page.headers(), body, signal: soon() });
    const told = await answer.json();
    if (!answer.ok) throw new Error(told.error);
    return told;
  }

  async function follow(request) {
    const stop = page.stops.get(request);
    while (stop.told && stop.told.open) {
      await pause(200);
      try {
        const answer = await fetch(`/api/stops/${encodeURIComponent(request)}`, { headers: page.headers() });
        if (answer.ok) page.answered(request, await answer.json());
      } catch {
        return; // the page shows that the console is silent
      }
    }
  }

  async function insist(request, stop) {
    while (!stop.answered) {
      stop.tries += 1;
      try {
        page.answered(request, await post(request, stop));
        follow(request);
      } catch (error) {
        stop.error = error.message || String(error);
        page.changed();
        await pause(AGAIN);
      }
    }
  }

  // Handle the result of a stop, from either route.
  page.answered = (request, told) => {
    const stop = page.stops.get(request);
    if (stop) Object.assign(stop, { answered: true, told, error: "" });
    page.changed();
  };

  // Stop robots by their identities; none means every robot.
  page.stop = (robots) => {
    page.endPads();
    const request = crypto.randomUUID();
    const stop = { robots, began: performance.now(), answered: false, told: null, tries: 0, error: "" };
    page.stops.set(request, stop);
    const sent = page.sendBySocket({ ask: "stop", request, robots });
    setTimeout(() => stop.answered || insist(request, stop), sent ? SECOND_WAY : 0);
    page.changed();
    return request;
  };

  let pressed = -Infinity;
  addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape" || event.repeat) return;
      page.endPads();
      if (event.timeStamp - pressed < TWICE) {
        pressed = -Infinity;
        event.preventDefault();
        page.stop([]);
      } else {
        pressed = event.timeStamp;
      }
    },
    true,
  );
  addEventListener("click", (event) => {
    const button = event.target.closest ? event.target.closest("[data-stop]") : null;
    if (!button) return;
    const whom = button.dataset.stop === "all" ? [] : page.selected();
    if (button.dataset.stop === "all" || whom.length) page.stop(whom);
    else page.changed("No robot is selected: choose robots in the list, or STOP ALL.");
  });
})();
