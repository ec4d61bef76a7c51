"""Simulated planes, QuadPlanes and VTOLs: what real ones were seen to do, and their refusals."""

import pytest

ACCEPTED = 0
MODES = {"TAKEOFF": 13, "GUIDED": 15}


def enters(it, name):
    return it.requests(176, 1, MODES[name])


@pytest.fixture
def plane(bench):
    it = bench("ardupilot", vehicle="plane")
    it.run(0.5)
    assert enters(it, "GUIDED") == [ACCEPTED]
    assert it.requests(400, 1) == [ACCEPTED]
    return it


@pytest.fixture
def flying(plane):
    assert enters(plane, "TAKEOFF") == [ACCEPTED]
    plane.until(lambda: plane.height > 45.0)
    return plane


def test_a_plane_ignores_velocities(flying):
    enters(flying, "GUIDED")
    flying.stream(3.0, 0.0)
    assert flying.body.speed > flying.body.slowest
