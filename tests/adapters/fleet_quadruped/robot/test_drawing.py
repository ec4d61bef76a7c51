"""A dog's body for drawings: its feet are where the walking puts them."""

import math

import pytest

from fleet.model.body import BodyPart
from fleet_quadruped.config import QuadrupedConfig
from fleet_quadruped.robot.description import EXAMPLE, DogDescription
from fleet_quadruped.robot.drawing import body_parts
from fleet_quadruped.robot.names import JOINTS, LEGS
from fleet_quadruped.robot.reading import checked, read_tree

DOG = checked(EXAMPLE, read_tree(EXAMPLE), DogDescription)
SELF_WALKING = EXAMPLE.with_name("self-walking.yaml")
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


def turned(axis, angle, point):
    """Return a point turned about x or y."""
    x, y, z = point
    cos, sin = math.cos(angle), math.sin(angle)
    if axis.x:
        return x, y * cos - z * sin, y * sin + z * cos
    return x * cos + z * sin, y, z * cos - x * sin


def end_of(parts, name, angles):
    """Return where a part ends in the robot's frame, by its chain of parents."""
    part: BodyPart = parts[name]
    point = (part.end.x, part.end.y, part.end.z)
    while True:
        point = turned(part.axis, angles.get(part.joint, 0.0), point)
        point = point[0] + part.at.x, point[1] + part.at.y, point[2] + part.at.z
        if not part.parent:
            return point
        part = parts[part.parent]


@pytest.mark.parametrize("leg", range(4), ids=LEGS)
def test_each_calf_ends_where_the_foot_is(leg):
    angles = {name: 0.3 - 0.17 * number for number, name in enumerate(JOINTS)}
    own = DOG.legs[leg]
    x, y, z = own.foot(tuple(angles[f"{LEGS[leg]}_{part}"] for part in ("abad", "hip", "knee")))
    parts = {part.name: part for part in body_parts(DOG)}
    expected = (own.x + x, own.y + y, z)
    assert end_of(parts, f"{LEGS[leg]}_calf", angles) == pytest.approx(expected)


def test_every_part_hangs_on_one_before_it_and_every_joint_is_one_that_is_reported():
    known = {""}
    for part in body_parts(DOG):
        assert part.parent in known
        known.add(part.name)
    assert {part.joint for part in body_parts(DOG)} == {"", *JOINTS}


def test_a_dog_is_drawn_by_its_config_and_a_machine_that_walks_by_itself_is_not():
    def config(**fields):
        return QuadrupedConfig(name="dog", twin=TWIN, adapter="quadruped", **fields)

    assert config(link="sim:kinematic").body_parts() == body_parts(DOG)
    assert config(body=SELF_WALKING, buses={"a": "can:socketcan:can0"}).body_parts() == ()
