"""Console pad in a real browser: time from releasing the button to zero velocity on the wire."""

import json
import os
import sys
import tempfile
import uuid
from pathlib import Path

from bench.common import free_port, line, process
from fleet.bus.settings import runtime_dir
from fleet.console.login_links import LinkRequest, request_link
from fleet.console.task import link_socket
from fleet.model.permission import Permission
from tests.browser import open_page
from tests.programs import find
from tests.tools.pad_wire import LEASE, RELEASED, WIRED, RobotWire, drive, kill_tab, release
from tests.tools.waiting import wait_until

ROUNDS = 40
KILLS = 5


def run():
    chromium = find("chromium")
    if chromium is None:
        sys.exit("chromium is missing: python3 run.py test fetches it")
    with tempfile.TemporaryDirectory(prefix="fb") as folder, RobotWire(free_port()) as wire:
        os.environ.update(FLEET_RUNTIME_DIR=folder, XDG_STATE_HOME=folder)
        path = Path(folder) / "fleet.yaml"
        robot = {"name": "rex", "twin": str(uuid.uuid4()), "adapter": "wired", "link": wire.link}
        robot["worker"] = "main"
        file = {"edge": {"id": "pad"}, "console": {"port": 0}, "plugins": [str(WIRED)], "robots": [robot]}
        path.write_text(json.dumps(file))
        with process(sys.executable, "-m", "fleet", "run", str(path), "--json"):
            measure(chromium, wire)


def measure(chromium, wire):
    """Drive and release repeatedly, then kill the tab while driving."""
    with open_page(chromium) as page:
        opened(page)
        released = []
        for _ in range(ROUNDS):
            drive(page, wire)
            released.append(release(page, wire))
    killed = []
    for _ in range(KILLS):
        with open_page(chromium) as page:
            opened(page)
            drive(page, wire)
            killed.append(kill_tab(page, wire))
    released.sort()
    p50 = released[len(released) // 2]
    p99 = released[int(len(released) * 0.99) - 1]
    line(
        "release to zero on the wire, p50 / p99",
        f"{p50 * 1e3:.0f} / {p99 * 1e3:.0f} ms",
        "aim: p99 at most 50",
    )
    line(
        f"killed tab to zero, at most of {KILLS}",
        f"{max(killed) * 1e3:.0f} ms",
        f"aim: {LEASE * 1e3 + 50:.0f}",
    )


def opened(page):
    """Open the console and select the robot."""
    page.set_default_timeout(60_000)
    page.goto(a_link())
    page.click('#robots li[data-id="pad/rex"]')
    page.wait_for_selector(".pad")
    page.evaluate(RELEASED)


def a_link():
    """Return a new console link, once the console serves."""
    requested = LinkRequest("bench", Permission.ADMIN)
    return wait_until("the console", lambda: request_link(link_socket(runtime_dir(), "pad"), requested)).link
