import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.body.motion import _straighter, folding, freeing, rising, rolling, sitting
from fleet_quadruped.robot.description import EXAMPLE, load_description

DOG = load_description(EXAMPLE)
FOLD = DOG.posture(DOG.poses.fold)
within = st.tuples(*[st.floats(joint.low + 0.04, joint.high - 0.04) for joint in DOG.all_joints])


def last(motion, dt=0.01):
    targets = motion.step(dt)
    while not motion.done:
        targets = motion.step(dt)
    return targets.angles


def test_standing_up_ends_standing():
    assert last(rising(DOG, FOLD, 0.27)) == pytest.approx(DOG.stance(0.27))


def test_sitting_down_ends_folded():
    assert last(sitting(DOG, DOG.stance(0.27), 0.27)) == pytest.approx(FOLD)


@given(within)
def test_folding_begins_where_the_joints_are_and_never_jumps(start):
    motion = folding(DOG, start)
    before = start
    while not motion.done:
        now = motion.step(0.01).angles
        assert max(abs(a - b) for a, b in zip(before, now, strict=True)) < 0.15
        before = now
    assert before == pytest.approx(FOLD)


def test_a_leg_that_lies_across_the_body_is_stretched_before_it_is_folded():
    start = list(FOLD)
    start[4] -= 1.4  # the hip of the front right leg
    motion = freeing(DOG, tuple(start))
    knees = [motion.step(0.01).angles[5] for _ in range(60)]
    assert max(knees) > start[5] + 0.8
    assert last(motion) == pytest.approx(FOLD)


@given(within)
def test_a_leg_is_stretched_within_the_limits_of_its_knee(start):
    crossed = (*start[:4], FOLD[4] - 1.4, *start[5:])
    motion = freeing(DOG, crossed)
    stretched = [motion.step(0.01).angles for _ in range(60)][-1]
    for number in (2, 5, 8, 11):
        joint = DOG.all_joints[number]
        assert joint.low <= stretched[number] <= joint.high
        assert abs(stretched[number]) <= abs(start[number]) + 1e-9


def test_a_knee_that_points_forward_is_stretched_the_other_way():
    forward = DOG.all_joints[2]._replace(low=0.4, high=2.75)
    assert _straighter(1.5, forward) == pytest.approx(0.6)
    assert _straighter(1.0, forward) == pytest.approx(0.4)


def test_legs_that_lie_free_are_folded_at_once():
    start = DOG.stance(0.27)
    assert freeing(DOG, start).step(0.01) == folding(DOG, start).step(0.01)


def test_rolling_without_a_roll_pose_is_refused():
    poses = DOG.poses.model_copy(update={"roll_near": None, "roll_far": None})
    with pytest.raises(ValueError, match="example has no roll poses"):
        rolling(DOG.model_copy(update={"poses": poses}), FOLD, to_left=True)
