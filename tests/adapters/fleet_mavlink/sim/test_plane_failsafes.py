"""Fail-safes of ArduPlane 4.6.3: RTL, FS_LONG_TIMEOUT after a loss."""

import math

import pytest

ACCEPTED = 0
MODES = {"RTL": 11, "TAKEOFF": 13, "GUIDED": 15}


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


def test_a_plane_without_its_station_flies_home_and_circles_there(flying):
    flying.set_param("FS_GCS_ENABL", 1)
    flying.set_param("FS_LONG_ACTN", 1)
    flying.set_param("SYSID_MYGCS", 255)
    flying.run(2.0)
    flying.gcs = False
    flying.until(lambda: flying.mode == "RTL", 10.0)
    assert "GCS Failsafe On" in flying.texts
    flying.run(90.0)
    assert math.hypot(flying.body.north, flying.body.east) < 130.0
    assert flying.height > 80.0
