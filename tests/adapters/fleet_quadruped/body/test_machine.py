"""What a dog does that is told to sit down before it stands."""

import msgspec
import pytest

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.robot.description import leg_angles
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import copy_of, stood_up
from tests.adapters.fleet_quadruped.kinds import on_one_kind


def heights(rig):
    """Return how high the hips are above each foot, as the joints were last sent, m."""
    angles = tuple(motor.target for motor in rig.sim.world.motors)
    return [-leg.foot(leg_angles(angles, number))[2] for number, leg in enumerate(rig.dog.legs)]


def rise_and_leave(rig, after):
    """Have a dog stand up, and tell it to leave meanwhile; return its heights, cycle by cycle."""
    assert rig.request(BodyRequest.STAND) == ""
    rig.go(after)
    assert rig.mode is BodyMode.RISING
    rig.order = msgspec.structs.replace(rig.order, leave=True)
    seen = []
    while rig.mode is not BodyMode.OFF:
        rig.cycle()
        if rig.mode is BodyMode.SITTING:
            seen.append(heights(rig))
    return seen


@on_one_kind
@pytest.mark.parametrize("after", [0.4, 1.2, 2.1])
def test_a_dog_that_is_asked_to_leave_while_it_rises_only_goes_down(any_dog, after):
    rig = copy_of(Rig, any_dog)
    rig.go(0.1)
    seen = rise_and_leave(rig, after)
    assert max(map(max, seen)) <= max(seen[0]) + 0.005
    assert max(seen[-1]) == pytest.approx(heights(rig)[0], abs=0.01)


def test_a_dog_in_its_walk_is_given_the_time_of_the_walk_until_it_sits_down(mit_dog):
    slow = mit_dog.gait.walk.model_copy(update={"period": 3.0})
    rig = Rig(mit_dog.model_copy(update={"gait": mit_dog.gait.model_copy(update={"walk": slow})}))
    rig.stand()
    rig.order = msgspec.structs.replace(rig.order, gait="walk")
    rig.go(3.0, Twist(0.15))
    rig.order = msgspec.structs.replace(rig.order, gait="trot", leave=True)  # as every halt says
    while max(heights(rig)) > 0.2:
        rig.cycle()
    assert not rig.controller.body.walker.walking
    rig.go(2.0, until=BodyMode.OFF)
    assert rig.mode is BodyMode.OFF


@on_one_kind
def test_a_walk_that_an_emergency_stop_cut_off_is_not_taken_up_by_sitting_down(any_dog):
    rig = copy_of(stood_up, any_dog)
    rig.go(1.05, Twist(0.4))
    rig.emergency()
    rig.go(0.1, until=BodyMode.DAMPED)
    rig.go(4.0, until=BodyMode.OFF)
    rig.go(0.1)
    seen = rise_and_leave(rig, 1.2)
    assert max(max(feet) - min(feet) for feet in seen) < 0.01  # no foot is lifted
