"""The pad in a real browser, a robot on a wire: how long it moves on when its driver lets go, or is gone."""

import contextlib
import json
import uuid

import pytest
from playwright.sync_api import Error

from tests.tools.pad_wire import LEASE, RELEASED, WIRED, RobotWire, drive, kill_tab, release

BUSY = 1.0  # s that a computer with ten times too much to do may take besides


@pytest.fixture
def wire(free_port):
    with RobotWire(free_port) as wire:
        yield wire


@pytest.fixture
def driven(fleet, page, wire, tmp_path):
    """Open the console's page with the robot selected."""
    name = f"yard-{uuid.uuid4().hex[:8]}"
    robot = {
        "name": "rex",
        "twin": str(uuid.uuid4()),
        "adapter": "wired",
        "worker": "main",
        "link": wire.link,
    }
    file = {"edge": {"id": name}, "console": {"port": 0}, "plugins": [str(WIRED)], "robots": [robot]}
    (tmp_path / "fleet.yaml").write_text(json.dumps(file))
    edge = fleet("run", str(tmp_path / "fleet.yaml"), "--json")
    edge.line(r"console: fleet console --link +prints a link")
    page.set_default_timeout(60_000)
    page.goto(edge.call("console", "--link").stdout.strip())
    page.click(f'#robots li[data-id="{name}/rex"]')
    page.wait_for_selector(".pad")
    page.evaluate(RELEASED)
    return page


def test_a_robot_stands_when_its_driver_lets_go_and_within_the_lease_when_the_tab_is_killed(driven, wire):
    for _ in range(2):
        drive(driven, wire)
        assert release(driven, wire) < 0.05 + BUSY
    drive(driven, wire)
    assert kill_tab(driven, wire) < LEASE + 0.05 + BUSY
    with contextlib.suppress(Error):
        driven.close()
