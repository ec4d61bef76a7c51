"""PX4's take-off: before it lifts off, until it ends below its height."""

import math

import pytest

ACCEPTED = 0
NAN = math.nan


def test_takeoff_takes_as_long_as_the_real_one_and_ends_in_loiter(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 498)
    px4.requests(400, 1)
    assert 4.5 < px4.until(lambda: px4.height > 0.5) < 5.7
    assert px4.mode == "TAKEOFF"
    assert px4.pilot.land_detector.state() == 3
    assert 6 < px4.until(lambda: px4.height > 9.7) < 9.5
    px4.run(1)
    assert px4.mode == "LOITER"
    assert px4.pilot.land_detector.state() == 2
    px4.run(2)
    assert px4.height == pytest.approx(10, abs=0.1)


def test_takeoff_at_latitude_0_never_leaves_the_ground(px4):
    px4.run(0.2)
    assert px4.requests(22, 0, 0, 0, 0, 0, 0, 498) == [ACCEPTED]
    assert px4.requests(400, 1) == [ACCEPTED]
    assert px4.mode == "TAKEOFF"
    px4.until(lambda: not px4.pilot.armed, 12)
    assert px4.height == 0


def test_takeoff_with_a_relative_altitude_only_hops(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 10)
    px4.requests(400, 1)
    px4.run(15)
    assert 0.3 < px4.height < 1.0
    assert "Already higher than takeoff altitude\t" in px4.texts


def test_takeoff_without_an_altitude_climbs_the_default(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, NAN)
    px4.requests(400, 1)
    px4.run(15)
    assert px4.height == pytest.approx(2.5, abs=0.3)


def test_takeoff_while_flying_climbs_on(flying):
    assert flying.requests(22, NAN, 0, 0, NAN, NAN, NAN, 503) == [ACCEPTED]
    flying.until(lambda: abs(flying.height - 15) < 0.3)
    flying.until(lambda: flying.mode == "LOITER")
