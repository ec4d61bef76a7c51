"""Robots of one edge are not sent into each other: the demo's drones, by the command line."""

import pytest

from fleet.cli.demo import FIELD


def _knows_all(state):
    return state["health"] == "ok" and "separation" not in state and "site" in state


@pytest.fixture
def hovering(fleet):
    """Start a demo of two drones that are in the air, each at its own place."""
    running = fleet("demo", "--drones", "2", "--ugvs", "1", "--json")
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

    for _ in range(30):  # they are not ready at once
        taken = hovering.call("send", "drones", "takeoff", "altitude=4", "--wait")
        if taken.returncode == 0:
            break
    assert taken.returncode == 0, taken.stdout + taken.stderr
    first = hovering.call("goto", "drone-1", "15", "16", "4", "--site")
    second = hovering.call("goto", "drone-2", "15", "16", "4", "--site")
    assert first.returncode == 0, first.stdout + first.stderr
    assert second.returncode == 5
    assert "m from drone-1's way, 3.2 m are kept" in second.stdout
    spread = hovering.call("goto", "drones", "15", "16", "4", "--site", "--spacing", "6", "--wait")
    assert spread.returncode == 0, spread.stdout + spread.stderr
    rows = hovering.call("ps").stdout.splitlines()
    assert "SITE" in rows[0]
    assert any(row.split()[0] == "ugv-1" and " 0.0 -2.0 0.0 " in row for row in rows[1:4])
