"""A robot rests when nothing moves it, nothing may move it, and nobody holds it."""

from types import SimpleNamespace

import pytest

from fleet.host.robot.rest_check import STILL, moving, not_resting
from fleet.testing.clock import ManualClock


def robot(*, in_motion=False, activity="", may_be_moving=False, holder="", **state):
    shown = {"name": "rex", "armed": None, "speed": None, "run": ""} | state
    controller = SimpleNamespace(
        in_motion=in_motion,
        activity=activity,
        motion=SimpleNamespace(may_be_moving=may_be_moving),
        lease=SimpleNamespace(control=lambda _now: holder),
    )
    return SimpleNamespace(controller=controller, clock=ManualClock(), state=lambda: SimpleNamespace(**shown))


@pytest.mark.parametrize(
    "at_rest", [robot(), robot(armed=False, speed=0.0), robot(speed=STILL), robot(activity="emergency stop")]
)
def test_a_robot_that_stands_rests(at_rest):
    assert (moving(at_rest), not_resting(at_rest)) == ("", "")


@pytest.mark.parametrize(
    ("moves", "why"),
    [
        (robot(in_motion=True, activity="goto"), "rex is commanded (goto); stop it first"),
        (robot(in_motion=True), "rex is commanded (moving); stop it first"),
        (robot(may_be_moving=True), "rex was lost in motion and may still move"),
        (robot(armed=True), "rex is armed; disarm it first"),
        (robot(speed=0.06), "rex moves at 0.06 m/s"),
        (robot(in_motion=True, may_be_moving=True, armed=True), "rex is commanded (moving); stop it first"),
    ],
)
def test_a_robot_that_moves_or_may_move_does_not_rest(moves, why):
    assert (moving(moves), not_resting(moves)) == (why, why)


@pytest.mark.parametrize(
    ("held", "why"),
    [
        (robot(run="3f2a"), "rex is in run 3f2a; fleet take takes it out of the run"),
        (robot(holder="anna has control"), "rex: anna has control"),
    ],
)
def test_a_robot_that_stands_but_is_held_does_not_rest(held, why):
    assert (moving(held), not_resting(held)) == ("", why)
