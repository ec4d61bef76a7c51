"""Wheeled robots of a real fleet, over real device files: what the base truly does."""

import json

import psutil
import pytest

from fleet.testing.waiting import wait_until

TWIN = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8c"


@pytest.fixture
def roll(fleet, broker, tmp_path):
    """Run a fleet of one base on a link; gives the process when the base is well."""

    def roll(port, profile, **fields):
        robot = {"name": "rover", "twin": TWIN, "adapter": "ugv", "profile": profile, "link": port.url}
        cloud = {"host": "127.0.0.1", "port": broker.port, "tls": False}
        file = {"edge": {"id": "yard"}, "cloud": cloud, "robots": [robot | fields]}
        (tmp_path / "fleet.yaml").write_text(json.dumps(file))
        running = fleet("run", "--json", folder=tmp_path)
        running.robot("rover", "is well", is_well)
        return running

    return roll


def is_well(state):
    return state["health"] == "ok"


def worker_of(running):
    """Return the one worker process of an edge."""
    [worker] = [
        child
        for child in psutil.Process(running.process.pid).children()
        if "fleet.host.worker" in child.cmdline()
    ]
    return worker


def test_a_base_whose_worker_is_killed_stops_within_its_own_time_and_stands(roll, bases, broker, ears):
    port = bases.add("waveshare-beast")
    running = roll(port, "waveshare-beast", worker="wheels")
    pilot = ears("127.0.0.1", broker.port, f"cyberwave/twin/{TWIN}/#").pilot(TWIN)
    for _ in range(2):
        pilot.hold("move_forward", until=lambda: port.board.physics.speeds[0] > 0.2)
        worker = worker_of(running)
        worker.kill()
        worker.wait(20)
        killed = port.now()
        wait_until("the board's own stop", lambda: port.board.halted_at is not None)
        assert port.board.halted_at - killed <= port.board.timeout + 0.1
        running.robot("rover", "is missed", lambda state: not is_well(state))
        running.robot("rover", "is back", is_well)
        assert port.board.physics.speeds == [0.0, 0.0]
