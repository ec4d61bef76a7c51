"""Kinematics of one leg: abduction about x, hip and knee about y; at zero it hangs straight down.

Feet are in the frame of the leg: origin on the abduction axis, x forward, y left, z up, metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

LegPoint = tuple[float, float, float]
LegAngles = tuple[float, float, float]
Reached = tuple[
    LegPoint, tuple[LegPoint, LegPoint, LegPoint]
]  # position of a foot, and its Jacobian by columns
_NEARLY = 0.999  # of the leg's full length: keeps the leg off its singularity


class DogLeg(NamedTuple):
    """Lengths in metres; ``x``, ``y``: origin in the body; ``side``: +1 left; ``knee``: -1 backward."""

    x: float
    y: float
    side: int
    knee: int
    offset: float
    thigh: float
    calf: float

    def foot(self, angles: LegAngles) -> LegPoint:
        """Return the centre of the foot."""
        return self.reach(angles)[0]

    def angles(self, foot: LegPoint) -> LegAngles:
        """Return the angles for this foot position, or for the nearest reachable one in its direction."""
        x, y, z = foot
        _, _, side, back, offset, thigh, calf = self
        out = side * offset
        down = math.sqrt(max(y * y + z * z - out * out, 1e-12))
        abad = math.atan2(out * z + down * y, out * y - down * z)
        length = math.hypot(x, down)
        longest, shortest = (thigh + calf) * _NEARLY, abs(thigh - calf) + 1e-3
        if not shortest <= length <= longest:
            length = shortest if length < shortest else longest
        one, two, square = thigh * thigh, calf * calf, length * length
        bend = math.acos((one + two - square) / (2 * thigh * calf))  # by the law of cosines
        lean = math.acos((one + square - two) / (2 * thigh * length))
        return abad, math.atan2(-x, down) - back * lean, back * (math.pi - bend)

    def reach(self, angles: LegAngles) -> Reached:
        """Return the centre of the foot, and its velocity for 1 rad/s of each joint."""
        abad, hip, knee = angles
        _, _, side, _, offset, thigh, calf = self
        cos, sin = math.cos(abad), math.sin(abad)
        low, low_x = calf * math.cos(hip + knee), -calf * math.sin(hip + knee)
        down, x = thigh * math.cos(hip) + low, low_x - thigh * math.sin(hip)
        out = side * offset
        y, z = out * cos + down * sin, out * sin - down * cos
        return (x, y, z), ((0.0, -z, y), (-down, x * sin, -x * cos), (-low, low_x * sin, -low_x * cos))

    def reaches(self, foot: LegPoint) -> bool:
        """Return True if the leg can reach this position."""
        return math.dist(self.foot(self.angles(foot)), foot) < 1e-3
