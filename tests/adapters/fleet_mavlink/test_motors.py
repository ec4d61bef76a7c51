"""The motors as joints of the twin: speeds as they are reported, and angles that follow from them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.motors import Motors
from fleet_mavlink.onboard_sensors import OnboardSensors, reduce_sensors
from fleet_mavlink.payload_messages import EscTelemetry1To4

NAMES = ("a", "b", "c", "d")


def turning(*rpm, at=1.0):
    """Return what is known after the motors' speeds were reported."""
    return reduce_sensors(OnboardSensors(), EscTelemetry1To4((*rpm, 0, 0, 0, 0)[:4]), at)


def test_motors_turn_as_fast_as_is_reported_and_their_angles_follow():
    motors, sensors = Motors(("a", "b")), turning(60, 120)
    first = motors.report(sensors, 1.0, 7.0)
    assert first.stamp == 7.0
    assert first.velocities == pytest.approx({"a": math.tau, "b": 2 * math.tau})
    assert first.positions == {"a": 0.0, "b": 0.0}, "no time has passed"
    second = motors.report(sensors, 1.25, 7.25)
    assert second.positions == pytest.approx({"a": math.tau / 4, "b": math.tau / 2})


def test_the_names_are_given_in_the_autopilots_order():
    report = Motors(NAMES).report(turning(60, 120, 180, 240), 1.0, 0.0)
    assert report.velocities == pytest.approx(
        dict(zip(NAMES, [math.tau * n for n in range(1, 5)], strict=True))
    )


@pytest.mark.parametrize(("names", "told"), [(NAMES[:2], NAMES[:2]), ((*NAMES, "e", "f"), NAMES)])
def test_only_motors_that_have_a_name_and_a_speed_are_reported(names, told):
    report = Motors(names).report(turning(60, 60, 60, 60), 1.0, 0.0)
    assert tuple(report.velocities) == tuple(report.positions) == told


def test_without_names_nothing_is_reported():
    assert Motors(()).report(turning(60), 1.0, 0.0) is None


def test_motors_whose_speed_was_never_reported_are_not_reported():
    assert Motors(NAMES).report(OnboardSensors(), 1.0, 0.0) is None


def test_a_speed_is_reported_for_three_seconds_after_it_arrived():
    motors, sensors = Motors(("a",)), turning(60, at=1.0)
    assert motors.report(sensors, 4.0, 0.0) is not None
    assert motors.report(sensors, 4.01, 0.0) is None


def test_the_time_without_speeds_turns_no_motor():
    motors = Motors(("a",))
    motors.report(turning(15, at=1.0), 1.0, 0.0)
    assert motors.report(turning(15, at=1.0), 2.0, 0.0).positions["a"] == pytest.approx(math.tau / 4)
    assert motors.report(turning(15, at=1.0), 10.0, 0.0) is None
    assert motors.report(turning(15, at=20.0), 20.0, 0.0).positions["a"] == pytest.approx(math.tau / 4)
    assert motors.report(turning(15, at=20.0), 21.0, 0.0).positions["a"] == pytest.approx(math.tau / 2)


@given(st.lists(st.tuples(st.integers(-30_000, 30_000), st.floats(0.0, 2.5)), min_size=1, max_size=20))
def test_an_angle_stays_within_one_turn_and_is_the_sum_of_all_speeds(steps):
    motors, now, angle = Motors(("a",)), 1.0, 0.0
    motors.report(turning(0), now, 0.0)
    for rpm, seconds in steps:
        now += seconds
        angle += rpm / 60 * math.tau * seconds
        told = motors.report(turning(rpm, at=now), now, 0.0).positions["a"]
        assert 0.0 <= told < math.tau
        assert math.remainder(told - angle, math.tau) == pytest.approx(0.0, abs=1e-6)
