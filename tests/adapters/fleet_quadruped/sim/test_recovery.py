import math
import random

import pytest

from fleet.model.geometry import quaternion_from_euler
from fleet_quadruped.body.machine import Ask
from fleet_quadruped.safety.stages import Mode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from fleet_quadruped.sim.tune import drop, random_turn

CHANCE = random.Random(7)
TURNS = [quaternion_from_euler(roll, 0, 0) for roll in (math.pi, 1.6, -1.6)] + [
    random_turn(CHANCE) for _ in range(3)
]


def lying(dog, turn):
    world = MujocoWorld(dog)
    drop(world, turn)
    rig = Rig(dog, world)
    rig.go(0.1)
    return rig


@pytest.mark.parametrize("turn", TURNS)
def test_it_gets_up_from_whatever_it_lies_on(dog, turn):
    rig = lying(dog, turn)
    assert rig.ask(Ask.RECOVER) == ""
    for _ in range(18):
        rig.go(1.0)
        if rig.mode is Mode.STANDING:
            break
    assert (rig.mode, rig.fault) == (Mode.STANDING, "")


def test_it_does_not_stand_up_while_it_is_on_its_back(dog):
    assert "send recovery_stand" in lying(dog, TURNS[0]).ask(Ask.STAND)


def test_without_roll_poses_it_says_that_it_needs_help(dog):
    poses = dog.poses.model_copy(update={"roll_near": None, "roll_far": None})
    rig = lying(dog.model_copy(update={"poses": poses}), TURNS[0])
    assert "put it on its feet" in rig.ask(Ask.RECOVER)
