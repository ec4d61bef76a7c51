"""PX4's take-off: before it lifts off, until it ends below its height."""

import math

import pytest

from fleet_mavlink.sim.px4_takeoff import wander

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


def test_a_take_off_is_told_two_seconds_after_arming_and_sets_home(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 498)
    px4.requests(400, 1)
    armed_home = px4.pilot.home.place
    assert 1.6 < px4.until(lambda: "Takeoff detected\t" in px4.texts) < 2.6
    assert px4.body.grounded
    assert px4.pilot.home.place is not armed_home
    assert not px4.pilot.land_detector.landed


def test_with_running_motors_it_lifts_off_sooner(px4):
    px4.run(0.2)
    px4.requests(400, 1)
    px4.run(6.0)
    assert px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 498) == [ACCEPTED]
    assert 0.3 < px4.until(lambda: "Takeoff detected\t" in px4.texts) < 0.8
    assert px4.body.grounded
    assert 2.2 < px4.until(lambda: px4.height > 0.1) < 3.2


@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_it_ends_below_its_height_by_the_acceptance_radius(px4, radius):
    px4.run(0.2)
    px4.set_param("NAV_MC_ALT_RAD", radius)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 498)
    px4.requests(400, 1)
    px4.until(lambda: px4.mode == "LOITER")
    assert px4.height == pytest.approx(10.0 - radius, abs=0.25)
    px4.run(5.0)
    assert px4.height == pytest.approx(10.0, abs=0.3)


def test_it_waits_armed_or_not_for_its_motors_and_is_forgotten_after_it_began(px4):
    px4.run(0.2)
    px4.requests(22, NAN, 0, 0, NAN, NAN, NAN, 498)
    px4.run(5.0)
    assert (px4.mode, px4.height) == ("TAKEOFF", 0.0)
    px4.requests(400, 1)
    px4.until(lambda: px4.height > 9.0)
    px4.requests(21)
    px4.until(lambda: not px4.pilot.armed)
    px4.requests(400, 1)
    px4.run(8.0)
    assert px4.height == 0.0


def test_in_the_air_it_is_in_the_air_at_once(flying):
    flying.requests(22, NAN, 0, 0, NAN, NAN, NAN, 503)
    assert flying.pilot.land_detector.state() == 2


def test_the_estimated_height_of_a_vehicle_on_the_ground_wanders_within_its_amplitude():
    heights = [wander(0.3, now / 10) for now in range(200)]
    assert max(heights) == pytest.approx(0.3, abs=0.01)
    assert min(heights) == pytest.approx(-0.3, abs=0.01)
