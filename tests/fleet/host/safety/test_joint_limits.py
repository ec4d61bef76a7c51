"""Joint targets within what the robot declares."""

import math

import pytest

from fleet.host.safety.joint_limits import refusal
from fleet.model.joints import JointRange

RANGES = {"hip": JointRange(-1.0, 1.0, 3.0), "knee": JointRange(0.0, 2.0, 3.0)}


@pytest.mark.parametrize("targets", [{}, {"hip": 1.0}, {"hip": -1.0, "knee": 2.0}])
def test_targets_within_the_ranges_are_taken(targets):
    assert refusal(targets, RANGES) is None


@pytest.mark.parametrize(
    ("targets", "why"),
    [
        ({"hip": 1.01}, "joint hip: 1.01 is outside"),
        ({"hip": math.nan}, "joint hip: a finite number is needed"),
        ({"knee": math.inf}, "joint knee: a finite number is needed"),
        ({"toe": 0.0}, "it has no joint 'toe' that takes targets; it has hip, knee"),
    ],
)
def test_other_targets_are_refused_with_the_joint(targets, why):
    assert refusal(targets, RANGES).startswith(why)


def test_a_robot_without_ranges_takes_none():
    assert refusal({"hip": 0.0}, {}) == "it takes no joint targets"
