"""Parts of a quadruped for drawings, from the geometry of its description."""

from __future__ import annotations

from collections.abc import Iterator

from fleet import BodyPart, Vector3
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.names import LEGS

_X, _Y = Vector3(1.0), Vector3(0.0, 1.0)  # axes
_HIGH, _HEAD = 0.09, 0.08  # m: assumed sizes of trunk and head; descriptions do not have them


def body_parts(dog: DogDescription) -> tuple[BodyPart, ...]:
    """Return trunk, head and legs; angles are joint angles, and legs hang straight down at zero."""
    shape = dog.geometry
    trunk = Vector3(2 * shape.hip_x, 2 * shape.hip_y, _HIGH)
    head = Vector3(shape.hip_x + _HEAD, 0.0, _HIGH / 2)
    return (
        BodyPart("trunk", size=trunk),
        BodyPart("head", "trunk", head, size=Vector3(_HEAD, _HEAD, _HEAD)),
        *(part for name in LEGS for part in _leg(dog, name)),
    )


def _leg(dog: DogDescription, name: str) -> Iterator[BodyPart]:
    """Yield the three links of a leg."""
    front, side = 1 if name[0] == "F" else -1, 1 if name[1] == "L" else -1
    shape = dog.geometry
    root = Vector3(front * shape.hip_x, side * shape.hip_y)
    hip, knee = Vector3(0.0, side * shape.abad_offset), Vector3(0.0, 0.0, -shape.thigh)
    yield BodyPart(f"{name}_abad", "trunk", root, f"{name}_abad", _X, hip)
    yield BodyPart(f"{name}_thigh", f"{name}_abad", hip, f"{name}_hip", _Y, knee)
    yield BodyPart(f"{name}_calf", f"{name}_thigh", knee, f"{name}_knee", _Y, Vector3(0.0, 0.0, -shape.calf))
