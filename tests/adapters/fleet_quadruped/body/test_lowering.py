"""In a hard stop the legs fold, unless a drive brakes: then all wait for it, and not for ever."""

import pytest

from fleet_quadruped.body.lowering import Lowering, level
from fleet_quadruped.robot.description import leg_angles

DT = 0.01
TOUCH, PATIENCE = 0.15, 1.0  # s


def heights(dog, posture):
    """Return the height of each foot above the hip axes."""
    return [leg.foot(leg_angles(posture, number))[2] for number, leg in enumerate(dog.legs)]


@pytest.fixture
def stand(dog):
    return dog.stance(0.27)


def lifted(dog, stand):
    """Return a stance with one foot in the air."""
    leg = dog.legs[0]
    x, y, z = leg.foot(leg_angles(stand, 0))
    return (*leg.angles((x, y, z + 0.05)), *stand[3:])


def go(lowering, seconds, *, braked=False):
    for _ in range(round(seconds / DT)):
        targets = lowering.step(DT, braked=braked)
    return targets


def test_the_legs_are_folded_in_part_of_the_time_and_have_settled_at_its_end(dog, stand):
    lowering = Lowering(dog, stand, upright=True)
    time = dog.safety.damp_time
    targets = go(lowering, TOUCH + 0.6 * time + 2 * DT)
    assert targets.angles == pytest.approx(dog.posture(dog.poses.fold))
    assert not lowering.done
    go(lowering, 0.4 * time)
    assert lowering.done
    assert not lowering.stuck


def test_a_lifted_foot_comes_down_first_where_it_is_upright(dog, stand):
    start = lifted(dog, stand)
    assert max(heights(dog, start)) - min(heights(dog, start)) == pytest.approx(0.05)
    feet = heights(dog, go(Lowering(dog, start, upright=True), TOUCH).angles)
    assert max(feet) - min(feet) < 0.005
    feet = heights(dog, go(Lowering(dog, start, upright=False), TOUCH).angles)
    assert max(feet) - min(feet) > 0.005


def test_all_feet_are_as_low_as_the_lowest_and_where_they_were(dog, stand):
    start = lifted(dog, stand)
    flat = level(dog, start)
    assert heights(dog, flat) == pytest.approx([min(heights(dog, start))] * 4)
    for number, leg in enumerate(dog.legs):
        assert leg.foot(leg_angles(flat, number))[:2] == pytest.approx(
            leg.foot(leg_angles(start, number))[:2]
        )


def test_while_a_drive_brakes_every_joint_holds_where_it_is(dog, stand):
    lowering = Lowering(dog, stand, upright=False)
    moving = go(lowering, 0.3)
    assert any(moving.speeds)
    held = go(lowering, 0.9, braked=True)
    assert held.angles == moving.angles
    assert not any(held.speeds)
    assert (lowering.done, lowering.stuck) == (False, False)
    on = lowering.step(DT, braked=False)
    assert on.angles == pytest.approx(moving.angles, abs=0.05)
    assert on.angles != moving.angles


def test_a_drive_that_brakes_first_of_all_leaves_the_posture_as_it_was(dog, stand):
    assert go(Lowering(dog, stand, upright=True), 0.1, braked=True).angles == stand


def test_a_drive_that_keeps_braking_is_given_up_and_short_brakes_do_not_add_up(dog, stand):
    lowering = Lowering(dog, stand, upright=True)
    for _ in range(3):
        go(lowering, PATIENCE - 0.1, braked=True)
        go(lowering, DT)
    assert not lowering.stuck
    go(lowering, PATIENCE + 0.05, braked=True)
    assert lowering.stuck
    assert not lowering.done
