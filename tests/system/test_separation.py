"""Robots of one edge are not sent into each other: the demo's drones, by the command line."""

import json

import pytest

from fleet.cli.demo import FIELD
from fleet.model.geometry import Vector3
from tests.tools.waiting import wait_until


def _knows_all(state):
    return state["health"] == "ok" and "separation" not in state and "site" in state


@pytest.fixture
def hovering(fleet):
    """Start a demo of two drones that are in the air, each at its own place."""
    running = fleet("demo", "--drones", "2", "--ugvs", "1", "--dogs", "0", "--json")
    for name in ("drone-1", "drone-2", "ugv-1"):
        running.robot(name, "is well and knows where all are", _knows_all)
    return running


def test_two_drones_are_not_sent_to_one_point_neither_as_a_group_nor_one_by_one(hovering):
    latitude, longitude, _ = map(str, FIELD)
    own = hovering.call("goto", "drones", "10", "0", "5")
    one_point = hovering.call("goto", "drones", latitude, longitude, "5", "--geo")
    assert (own.returncode, one_point.returncode) == (5, 5)
    assert "no frame in common" in own.stderr
    assert "one point for 2 robots" in one_point.stderr

    takeoff = ("send", "drones", "takeoff", "altitude=4", "--wait")
    wait_until("both, once they are ready", lambda: hovering.call(*takeoff).returncode == 0, within=90)
    first = hovering.call("goto", "drone-1", "15", "16", "4", "--site")
    second = hovering.call("goto", "drone-2", "15", "16", "4", "--site")
    assert first.returncode == 0, first.stdout + first.stderr
    assert second.returncode == 5
    assert "m from drone-1's way, 3.2 m are kept" in second.stdout
    # So far apart that drone-1 may be at the point itself by now.
    spread = hovering.call("goto", "drones", "15", "16", "4", "--site", "--spacing", "8", "--wait")
    assert spread.returncode == 0, spread.stdout + spread.stderr
    robots = {state["name"]: state for state in json.loads(hovering.call("ps", "--json").stdout)["robots"]}
    assert robots["ugv-1"]["site"] == {"x": 0.0, "y": -2.0, "z": 0.0}
    where = [Vector3(**robots[name]["site"]) for name in ("drone-1", "drone-2")]
    assert 7.0 < (where[0] - where[1]).norm() < 9.0
