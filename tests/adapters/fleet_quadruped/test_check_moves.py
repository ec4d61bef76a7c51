import pytest

from fleet.testing.clock import ManualClock
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.check_moves import CheckMoves
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig


def run(rig, moves, clock, seconds=40.0):
    """Let the moves have their way, to their end."""
    while not rig.order.leave and rig.sim.time < seconds:
        rig.order = moves.order()
        rig.cycle()
        clock.advance(rig.dog.dt)
        moves.put(rig.state())


def test_a_key_makes_it_give_way_at_once_and_be_off(dog):
    rig, clock = Rig(dog, MujocoWorld(dog)), ManualClock()
    moves = CheckMoves(dog, clock, lambda: rig.sim.time > 5.0)
    run(rig, moves, clock)
    assert rig.mode is BodyMode.OFF
    assert rig.sim.time < 8.0
    assert moves.ended == "emergency stop"


def test_a_dog_that_is_refused_is_reported_with_the_reason(dog):
    rig, clock = Rig(dog.model_copy(update={"imu": None})), ManualClock()
    moves = CheckMoves(dog, clock, lambda: False)
    run(rig, moves, clock)
    assert moves.ended == "its attitude is unknown without an IMU"
    assert moves.looks == []


def test_it_is_off_and_folded_at_its_end(mit_dog):
    """That it ends so with each kind of drives is a part of each whole check: test_commissioning.py."""
    rig = Rig(mit_dog)
    rig.go(0.1)
    assert rig.request(BodyRequest.CHECK) == ""
    rig.go(30.0)
    assert (rig.mode, rig.fault) == (BodyMode.OFF, "")
    folded = mit_dog.posture(mit_dog.poses.fold)
    assert [motor.angle for motor in rig.sim.world.motors] == pytest.approx(folded, abs=0.05)
