"""Rotation of vectors between body and world frame."""

from __future__ import annotations

from fleet import Quaternion
from fleet_quadruped.body.legs import LegPoint


def to_world(rotation: Quaternion, vector: LegPoint) -> LegPoint:
    """Rotate a vector from the body frame into the world frame; ``rotation`` is body to world."""
    w, x, y, z = rotation.w, rotation.x, rotation.y, rotation.z
    a, b, c = vector
    tx, ty, tz = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


def to_body(rotation: Quaternion, vector: LegPoint) -> LegPoint:
    """Rotate a vector from the world frame into the body frame; ``rotation`` is body to world."""
    return to_world(Quaternion(rotation.w, -rotation.x, -rotation.y, -rotation.z), vector)
