"""How high a dog stands, from its joints and its tilt: nobody measures it, but its lowest foot is down."""

from __future__ import annotations

from collections.abc import Sequence

from fleet import Quaternion
from fleet_quadruped.body.legs import Leg
from fleet_quadruped.robot.description import leg_angles
from fleet_quadruped.robot.names import Twelve


def height_of(legs: Sequence[Leg], foot_radius: float, posture: Twelve, turn: Quaternion) -> float:
    """Return the metres from the middle of the hip axes down to the lowest foot, at least 0.

    ``turn``: from the body to the world. Of a dog that lies on its side or its back it says little.
    """
    ahead, aside, up = _down(turn)
    lowest = 0.0
    for number, leg in enumerate(legs):
        x, y, z = leg.foot(leg_angles(posture, number))
        lowest = min(lowest, ahead * (leg.x + x) + aside * (leg.y + y) + up * z)
    return foot_radius - lowest if lowest < 0.0 else 0.0


def _down(turn: Quaternion) -> tuple[float, float, float]:
    """Return the last row of the rotation: how much each axis of the body points up."""
    w, x, y, z = turn.w, turn.x, turn.y, turn.z
    return 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
