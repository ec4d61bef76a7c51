"""A recovery: free the legs, fold, and roll, to one side and then to the other."""

import pytest

from fleet_quadruped.body.recovery import Recovery
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)
FOLD, STANCE = DOG.posture(DOG.poses.fold), DOG.stance(0.27)
TO_LEFT = DOG.posture(DOG.poses.roll_near, DOG.poses.roll_far)
TO_RIGHT = DOG.posture(DOG.poses.roll_far, DOG.poses.roll_near)
ON_ITS_RIGHT, ON_ITS_LEFT = 1.4, -1.4  # rad of roll: the side that is up is the other one


def side(motion):
    """Return to which side a motion rolls."""
    seen = [motion.step(0.05).angles for _ in range(29)]
    assert (TO_LEFT in seen) != (TO_RIGHT in seen)
    return "left" if TO_LEFT in seen else "right"


def last(motion):
    """Return the posture in which a motion ends."""
    while not motion.done:
        angles = motion.step(0.05).angles
    return angles


@pytest.mark.parametrize(
    ("lean", "sides"),
    [
        (ON_ITS_RIGHT, ["left", "right", "left", "right", "left"]),
        (ON_ITS_LEFT, ["right", "left", "right", "left", "right"]),
    ],
)
def test_it_rolls_towards_the_side_that_is_up_and_every_second_time_the_other_way(lean, sides):
    recovery = Recovery(DOG)
    assert [side(recovery.roll(lean, FOLD)) for _ in range(5)] == sides


def test_after_five_rolls_it_gives_up_until_it_is_begun_again():
    recovery = Recovery(DOG)
    assert all(recovery.roll(1.0, FOLD) for _ in range(5))
    assert (recovery.tries, recovery.roll(1.0, FOLD)) == (5, None)
    recovery.begin(FOLD)
    assert recovery.tries == 0
    assert side(recovery.roll(1.0, FOLD)) == "left"


def test_a_roll_ends_folded():
    assert last(Recovery(DOG).roll(1.0, STANCE)) == FOLD


def test_without_roll_poses_it_does_not_roll():
    poses = DOG.poses.model_copy(update={"roll_near": None, "roll_far": None})
    recovery = Recovery(DOG.model_copy(update={"poses": poses}))
    assert recovery.roll(1.0, FOLD) is None
    assert recovery.tries == 0


def test_it_begins_by_folding_from_where_the_legs_are():
    motion = Recovery(DOG).begin(STANCE)
    assert motion.step(1e-6).angles == pytest.approx(STANCE, abs=1e-3)
    assert last(motion) == FOLD


def test_a_leg_under_the_body_is_straightened_first():
    trapped = list(FOLD)
    trapped[1] -= 1.5
    motion = Recovery(DOG).begin(tuple(trapped))
    for _ in range(6):
        angles = motion.step(0.1).angles
    assert abs(angles[2]) < abs(FOLD[2]) - 0.5
    assert last(motion) == FOLD
