"""Simulated dogs that were made once: a test gets a copy, which no other test sees.

To stand up takes a third of a second of processor time, a copy takes some milliseconds.
"""

import copy
import copyreg
import struct

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig

copyreg.pickle(struct.Struct, lambda layout: (struct.Struct, (layout.format,)))

_made = {}


def copy_of(make, dog):
    """Return a copy of what ``make(dog)`` returned at its first call with such a description."""
    key = make, dog.model_dump_json(by_alias=True)
    if key not in _made:
        _made[key] = make(dog)
    return copied(_made[key])


def copied(rig):
    """Return a copy of a rig; its description is immutable, and the same."""
    return copy.deepcopy(rig, {id(rig.dog): rig.dog})


def quick(dog):
    """Return the description of a dog that stands up, sits down and gives way in less time."""
    poses = dog.poses.model_copy(update={"rise_time": 0.6, "sit_time": 0.6})
    safety = dog.safety.model_copy(update={"damp_time": 1.5})
    return dog.model_copy(update={"poses": poses, "safety": safety})


def stood_up(dog):
    """Return a kinematic dog that has stood up."""
    return up(Rig(dog))


def stood_up_in_physics(dog):
    """Return a dog that has stood up in physics, and come to rest."""
    rig = up(Rig(dog, MujocoWorld(dog)))
    rig.go(0.7)
    return rig


def set_off(dog):
    """Return a kinematic dog in mid-trot."""
    rig = copy_of(stood_up, dog)
    rig.go(0.6, Twist(0.4))
    assert rig.mode is BodyMode.WALKING
    return rig


def up(rig):
    """Let a dog stand up."""
    rig.stand()
    return rig


def standing_dog(dog):
    """Return a kinematic dog that stands, and does so in less time."""
    return copy_of(stood_up, quick(dog))


def standing_in_physics(dog):
    """Return a dog that stands in physics."""
    return copy_of(stood_up_in_physics, dog)


def walking_dog(dog):
    """Return a kinematic dog in mid-trot, which stands up in less time."""
    return copy_of(set_off, quick(dog))
