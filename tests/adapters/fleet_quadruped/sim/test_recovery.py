import math
import random

import pytest

from fleet.model.geometry import quaternion_from_euler
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from fleet_quadruped.sim.tune import drop, random_turn, tries_needed

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


@pytest.mark.combinations
@pytest.mark.parametrize("turn", TURNS)
def test_it_gets_up_from_whatever_it_lies_on(any_dog, turn):
    rig = lying(any_dog, turn)
    assert rig.request(BodyRequest.RECOVER) == ""
    rig.go(24.0, until=BodyMode.STANDING)
    assert (rig.mode, rig.fault) == (BodyMode.STANDING, "")


def orientations(count):
    rng = random.Random(99)
    return [random_turn(rng) for _ in range(count)]


def test_a_dog_with_soft_joints_frees_a_leg_that_lies_under_its_body(mit_dog):
    assert tries_needed(mit_dog, orientations(32)[31]) is not None


def test_it_gets_up_from_each_of_many_orientations(any_dog, request):
    """All of ``--soak``'s sixty are in docs/how-to/quadruped.md."""
    count = 60 if request.config.getoption("--soak") else 3
    assert [turn for turn in orientations(count) if tries_needed(any_dog, turn, most=5) is None] == []


def test_tuning_heeds_the_monitor_and_the_limits_of_reality(dog):
    strict = dog.model_copy(update={"safety": dog.safety.model_copy(update={"following": 0.01})})
    assert tries_needed(dog, TURNS[1]) is not None
    assert tries_needed(strict, TURNS[1]) is None


def test_it_does_not_stand_up_while_it_is_on_its_back(dog):
    assert "send recovery_stand" in lying(dog, TURNS[0]).request(BodyRequest.STAND)


def test_without_roll_poses_it_says_that_it_needs_help(dog):
    poses = dog.poses.model_copy(update={"roll_near": None, "roll_far": None})
    rig = lying(dog.model_copy(update={"poses": poses}), TURNS[0])
    assert "put it on its feet" in rig.request(BodyRequest.RECOVER)
