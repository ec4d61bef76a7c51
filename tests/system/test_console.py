"""The console of the demo in a real browser: the fleet at once, a click that moves a robot, a stop by key."""

import json
import os
import signal
import time
import urllib.request
import uuid
from pathlib import Path

import pytest

from fleet.console.login_links import LinkRequest, request_link
from fleet.console.task import link_socket
from fleet.model.permission import Permission
from tests.tools.command_client import PUPPETS
from tests.tools.waiting import wait_until

UGV = "demo/ugv-1"
WAIT = 60_000  # ms


@pytest.fixture
def demo(program, fleet):
    """Run the demo, which ends after the page is closed; without a browser the test ends before it."""
    program("chromium")
    return fleet("demo", "--drones", "1", "--ugvs", "1", "--dogs", "0", "--json")


def test_the_demo_prints_a_link_to_a_page_where_a_click_moves_a_robot_and_escape_stops_it(demo, page):
    link = demo.line(r"console +(http://127\.0\.0\.1:\d+/#token=\S+)")[1]
    demo.robot("ugv-1", "is well", lambda state: state["health"] == "ok")
    demo.robot("drone-1", "is well", lambda state: state["health"] == "ok")
    page.set_default_timeout(WAIT)
    began = time.monotonic()
    page.goto(link)
    page.wait_for_selector('#robots li[data-id="demo/drone-1"]')
    shown = time.monotonic() - began
    assert shown < 40, f"{shown:.1f} s; a second when the machine is idle"

    page.click(f'#robots li[data-id="{UGV}"]')
    page.wait_for_selector("button.command")
    x, y = wait_until("a pose", lambda: page.evaluate(f"fleetPage.whereIs('{UGV}')"))
    page.mouse.click(x + 90, y)
    page.click("#target button.primary")
    demo.robot("ugv-1", "moves", lambda state: state.get("speed") and state["speed"] > 0.05)

    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    stopped = page.locator("#stop-words", has_text="2 of 2 stops set")
    stopped.wait_for()
    page.locator("#stop-words", has_text="2 seen standing").wait_for()
    assert demo.robot("ugv-1", "stands", lambda state: state.get("emergency_stop"))["emergency_stop"]


def test_an_edge_starts_its_console_and_starts_it_again_when_it_dies(fleet, runtime, tmp_path):
    name = f"yard-{uuid.uuid4().hex[:8]}"
    robot = {"name": "rex", "twin": str(uuid.uuid4()), "adapter": "puppet", "worker": "main", "rate": 0}
    file = {"edge": {"id": name}, "console": {"port": 0}, "plugins": [str(PUPPETS)], "robots": [robot]}
    (tmp_path / "fleet.yaml").write_text(json.dumps(file))
    edge = fleet("run", str(tmp_path / "fleet.yaml"), "--json")
    edge.line(r"console: fleet console --link +prints a link")
    link = edge.call("console", "--link").stdout.strip()
    with urllib.request.urlopen(link) as page:
        assert b"STOP ALL" in page.read()
    assert "#token" not in "".join(edge.errors)

    path, requested = link_socket(Path(runtime), name), LinkRequest("anna", Permission.VIEW)
    first = request_link(path, requested).process
    os.kill(first, signal.SIGKILL)

    def again():
        given = request_link(path, requested)
        return given is not None and given.process != first

    wait_until("another console", again)
    edge.robot("rex", "is well all the time", lambda state: state["health"] == "ok")
