"""A robot that is commanded and does not get on is seen to be stuck, and one that stands by itself is not."""

import math

import pytest

from fleet.host.follow.stuck import (
    MOVED,
    NEARER,
    NOT_NEARER_AFTER,
    REQUESTED_SPEED,
    REQUESTED_TURN,
    STUCK_AFTER,
    TURNED,
    StuckDetector,
)
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity, quaternion_from_euler

FAST = Velocity(Vector3(0.5))
SPIN = Velocity(yaw_rate=1.0)


def at(x=0.0, y=0.0, z=0.0, yaw=0.0):
    return Pose(Vector3(x, y, z), quaternion_from_euler(0.0, 0.0, yaw))


def stuck_at(pose_of, velocity=FAST, remaining_of=lambda _now: 5.0, *, until=20.0):
    """Return when the robot is first seen to be stuck, to a tenth of a second; None if it is not."""
    detector = StuckDetector()
    for tenth in range(int(until * 10)):
        now = 100.0 + tenth / 10
        if detector.update(pose_of(tenth / 10), velocity, remaining_of(tenth / 10), now):
            return tenth / 10
    return None


@pytest.mark.parametrize("velocity", [FAST, SPIN, Velocity(Vector3(-0.5)), Velocity(Vector3(0.0, 0.5))])
def test_one_that_is_commanded_and_stands_is_stuck_after_three_seconds(velocity):
    assert stuck_at(lambda _: at(), velocity) == pytest.approx(STUCK_AFTER + 0.1)


@pytest.mark.parametrize(
    ("velocity", "watched"),
    [
        (ZERO_VELOCITY, False),
        (Velocity(Vector3(REQUESTED_SPEED - 0.01)), False),
        (Velocity(Vector3(REQUESTED_SPEED)), True),
        (Velocity(Vector3(0.03, 0.03)), True),
        (Velocity(Vector3(z=1.0)), False),
        (Velocity(yaw_rate=REQUESTED_TURN - 0.01), False),
        (Velocity(yaw_rate=REQUESTED_TURN), True),
        (Velocity(yaw_rate=-REQUESTED_TURN), True),
    ],
)
def test_one_that_is_hardly_commanded_is_not_watched(velocity, watched):
    assert (stuck_at(lambda _: at(), velocity) is not None) is watched


@pytest.mark.parametrize("axis", ["x", "y"])
def test_one_that_gets_on_is_not_stuck(axis):
    assert stuck_at(lambda now: at(**{axis: 0.02 * now}), remaining_of=lambda now: 5.0 - 0.02 * now) is None


def test_one_that_creeps_less_than_a_hand_in_three_seconds_is_stuck():
    assert stuck_at(lambda now: at(x=0.005 * now)) == pytest.approx(STUCK_AFTER + 0.1)


def test_one_that_only_sinks_is_stuck():
    assert stuck_at(lambda now: at(z=0.5 * now)) == pytest.approx(STUCK_AFTER + 0.1)


@pytest.mark.parametrize("sign", [1, -1])
def test_one_that_turns_on_the_spot_is_not_stuck_also_past_the_seam_of_the_compass(sign):
    assert stuck_at(lambda now: at(yaw=sign * (3.0 + 0.2 * now)), SPIN) is None
    assert stuck_at(lambda now: at(yaw=sign * 0.01 * now), SPIN) is not None


@pytest.mark.parametrize("just", [at(x=MOVED + 0.001), at(yaw=TURNED + 0.001)])
def test_progress_starts_the_time_again(just):
    detector = StuckDetector()
    detector.update(at(), FAST, 5.0, 0.0)
    assert not detector.update(just, FAST, 5.0, 2.9)
    assert not detector.update(just, FAST, 4.0, 5.8)
    assert detector.update(just, FAST, 4.0, 6.0)


@pytest.mark.parametrize("hardly", [at(x=MOVED - 0.001), at(yaw=TURNED - 0.001)])
def test_noise_is_no_progress(hardly):
    detector = StuckDetector()
    detector.update(at(), FAST, 5.0, 0.0)
    assert not detector.update(hardly, FAST, 5.0, 3.0)
    assert detector.update(hardly, FAST, 5.0, 3.1)


def test_one_that_goes_in_circles_and_comes_no_nearer_is_stuck():
    circle = lambda now: at(math.cos(now), math.sin(now), yaw=now)  # noqa: E731
    assert stuck_at(circle) == pytest.approx(NOT_NEARER_AFTER + 0.1)
    assert stuck_at(circle, SPIN) is None, "it only turns"


@pytest.mark.parametrize(("by", "gets_on"), [(NEARER + 0.001, True), (NEARER - 0.001, False)])
def test_coming_nearer_by_a_step_starts_that_time_again(by, gets_on):
    detector = StuckDetector()
    for tenth in range(80):
        now = tenth / 10
        remaining = 5.0 if now < 4.0 else 5.0 - by
        if detector.update(at(x=0.1 * now), FAST, remaining, now):
            break
    assert (now > 7.8) is gets_on


def test_one_that_falls_back_has_to_come_nearer_than_ever():
    remaining = lambda now: 1.0 if now < 1.0 else 5.0 - 0.1 * now  # noqa: E731
    assert stuck_at(lambda now: at(x=now), remaining_of=remaining) == pytest.approx(NOT_NEARER_AFTER + 0.1)


@pytest.mark.parametrize("how", ["reset", "stands"])
def test_after_a_rest_the_time_starts_again(how):
    detector = StuckDetector()
    detector.update(at(), FAST, 5.0, 0.0)
    assert detector.update(at(), FAST, 5.0, 10.0)
    if how == "reset":
        detector.reset()
    else:
        assert not detector.update(at(), ZERO_VELOCITY, 5.0, 10.1)
    assert not detector.update(at(), FAST, 5.0, 12.0)
    assert not detector.update(at(), FAST, 5.0, 15.0)
    assert detector.update(at(), FAST, 5.0, 15.1)
