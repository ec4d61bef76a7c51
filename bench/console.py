"""Load of the console: 200 robots that report ten times a second, and twenty tabs, of which five never read.

Measures the console's processor and memory, the command latency of the edge with and without the tabs (in
turns, as in ``bench record``), and in a real browser the first paint, the script time of a frame and the
longest task.
"""

import contextlib
import json
import os
import statistics
import sys
import time
import urllib.request

import psutil

from bench.bridge.sides import side
from bench.common import (
    bare_client,
    cpu_seconds,
    line,
    listener,
    mosquitto,
    process,
    quantiles,
    set_realtime,
    wait_for,
    without_deep_sleep,
)
from bench.record import send
from fleet.bus.settings import runtime_dir
from fleet.console.login_links import LinkRequest, request_link
from fleet.console.task import link_socket
from fleet.model.permission import Permission
from tests.browser import open_page
from tests.programs import find

ROBOTS, RATE = 200, 10.0
READING, SILENT = 15, 5
TURNS = 6
COMMANDS = 250  # per turn
WATCHED = 30.0  # s in which processor and memory of the console are measured
DRAWN = 10.0  # s in which the frames of the page are measured

TABS = """
import json, os, sys, threading, time
from websockets.sync.client import connect
base, cookie, proof, reading, silent = json.loads(sys.argv[1])
os.nice(19)
def opened():
    return connect(
        base.replace("http", "ws") + "/ws", origin=base, additional_headers={"Cookie": cookie},
        subprotocols=["fleet.console", proof], ping_interval=None,
    )
def read():
    with opened() as tab:
        for _ in tab:
            pass
kept = [opened() for _ in range(silent)]
readers = [threading.Thread(target=read, daemon=True) for _ in range(reading)]
for each in readers:
    each.start()
print("up", flush=True)
threading.Event().wait()
"""

FRAMES = """
async (seconds) => {
  let longest = 0, frames = 0;
  new PerformanceObserver((found) => {
    for (const one of found.getEntries()) longest = Math.max(longest, one.duration);
  }).observe({type: "longtask"});
  const end = performance.now() + seconds * 1000;
  await new Promise((done) => {
    const frame = (now) => { frames += 1; now < end ? requestAnimationFrame(frame) : done(); };
    requestAnimationFrame(frame);
  });
  return [frames, longest];
}
"""


def run():
    """Measure the console, then the commands of the edge, then the page."""
    with mosquitto() as port, contextlib.ExitStack() as stack:
        options = {"number": ROBOTS, "rate": RATE, "pose_only": True, "console": {"port": 0}}
        running = stack.enter_context(side("fleet", port, **options))
        os.environ["FLEET_RUNTIME_DIR"] = running.runtime
        wait_for(new_link)
        with tabs(READING, SILENT):
            measure_server(new_link().process)
        sender = stack.enter_context(bare_client(port, "sender"))
        stack.enter_context(without_deep_sleep())
        set_realtime(listener(port).pid)
        measure_commands(sender, running)
        measure_page()


def new_link():
    """Return a new link to the console with its process ID, or None while it does not serve."""
    return request_link(link_socket(runtime_dir(), "bench"), LinkRequest("bench", Permission.ADMIN))


@contextlib.contextmanager
def tabs(reading, silent):
    """Keep WebSockets of pages open in a separate process of the lowest priority."""
    base, _, token = new_link().link.partition("/#token=")
    headers = {"Origin": base, "Content-Type": "application/json"}
    body = json.dumps({"token": token}).encode()
    with urllib.request.urlopen(urllib.request.Request(base + "/api/session", body, headers)) as answer:
        cookie = answer.headers["Set-Cookie"].partition(";")[0]
        proof = json.load(answer)["proof"]
    arguments = json.dumps([base, cookie, proof, reading, silent])
    with process(sys.executable, "-c", TABS, arguments, stdout=-1) as opened:
        assert opened.stdout.readline() == b"up\n"
        yield


def measure_server(pid):
    """Print the processor time and the memory of the console with all tabs."""
    console = psutil.Process(pid)
    time.sleep(WATCHED / 3)
    before, spent, began = console.memory_info().rss, cpu_seconds(pid), time.monotonic()
    time.sleep(WATCHED)
    share = (cpu_seconds(pid) - spent) / (time.monotonic() - began)
    grown = (console.memory_info().rss - before) / 2**20
    line(f"console, {READING} tabs that read and {SILENT} that never do", f"{share:.1%}", "aim: at most 10 %")
    line(
        f"its memory, and its growth in {WATCHED:g} s", f"{before / 2**20:.0f} + {grown:.1f} MiB", "aim: flat"
    )


def measure_commands(sender, running):
    """Print the command latency of the edge without and with the tabs."""
    taken = {False: [], True: []}
    for turn in range(TURNS):
        for watched in (False, True) if turn % 2 else (True, False):
            first = 1 + (2 * turn + watched) * COMMANDS
            with tabs(READING, SILENT) if watched else contextlib.nullcontext():
                time.sleep(1)
                sent = send(sender, running.twins, range(first, first + COMMANDS))
                time.sleep(0.5)
            arrived = running.executed()
            taken[watched].append([arrived[each] - at for each, at in sent.items() if each in arrived])
    middle = {}
    for watched, name in ((False, "no tabs"), (True, "all tabs")):
        p50, p99 = (each * 1e6 for each in quantiles([one for turn in taken[watched] for one in turn]))
        middle[watched] = statistics.median(quantiles(turn)[1] for turn in taken[watched])
        line(f"command of the edge, {name}, p50 / p99", f"{p50:.0f} / {p99:.0f} us")
    ratio = middle[True] / middle[False]
    line(f"p99 with tabs against without, medians of {TURNS} turns", f"{ratio:.2f} x", "aim: at most 1.10")


def measure_page():
    """Print first paint, script time per frame and longest task of the page in a real browser."""
    chromium = find("chromium")
    if chromium is None:
        sys.exit("chromium is missing: python3 run.py test fetches it")
    with open_page(chromium) as page:
        page.goto(new_link().link)
        page.wait_for_function(f"document.querySelectorAll('#robots li[data-id]').length >= {ROBOTS}")
        painted = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime / 1000")
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable")
        before = script_seconds(session)
        frames, longest = page.evaluate(FRAMES, DRAWN)
        spent = (script_seconds(session) - before) / frames * 1e3
    line("page: first paint", f"{painted:.2f} s", "aim: under 1 s")
    line(f"page: script time of a frame, mean of {frames}", f"{spent:.1f} ms", "aim: at most 8 ms")
    line("page: longest task", f"{longest:.0f} ms", "aim: none over 50 ms")


def script_seconds(session):
    """Return the seconds that scripts of the page have run."""
    found = {each["name"]: each["value"] for each in session.send("Performance.getMetrics")["metrics"]}
    return found["ScriptDuration"]
