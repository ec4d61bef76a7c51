"""Standing height, estimated from joints and tilt: the lowest foot is on the ground."""

from __future__ import annotations

from collections.abc import Sequence

from fleet import Quaternion
from fleet_quadruped.body.legs import DogLeg
from fleet_quadruped.robot.description import leg_angles
from fleet_quadruped.robot.names import Twelve


def height_of(legs: Sequence[DogLeg], foot_radius: float, posture: Twelve, turn: Quaternion) -> float:
    """Return the height (m) of the centre of the hip axes above the ground at the lowest foot, at least 0.

    ``turn``: rotation from body to world. Not meaningful for a robot on its side or back.
    """
    ahead, aside, up = _down(turn)
    lowest = 0.0
    for number, leg in enumerate(legs):
        x, y, z = leg.foot(leg_angles(posture, number))
        lowest = min(lowest, ahead * (leg.x + x) + aside * (leg.y + y) + up * z)
    return foot_radius - lowest if lowest < 0.0 else 0.0


def _down(turn: Quaternion) -> tuple[float, float, float]:
    """Return the last row of the rotation matrix: the upward component of each body axis."""
    w, x, y, z = turn.w, turn.x, turn.y, turn.z
    return 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
