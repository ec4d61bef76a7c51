"""Position of the body over its feet, so that the centre of pressure stays between the standing feet.

A body on legs is an inverted pendulum: at height h it falls away from its centre of pressure, and an
acceleration a moves the centre of pressure behind the body's centre by a h/g. Both are known in advance,
because the gait and the requested velocity are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fleet_quadruped.body.legs import LegPoint

GRAVITY = 9.81  # m/s2
_LEAN_TIME = 0.1  # s: time constant of leaning into an acceleration
_SHIFT_TIME = 0.04  # s: time constant of shifting the weight from foot to foot
# Distance (m) that the centre of pressure keeps from the line between two feet, and its largest share of the
# distance from that line to the third foot.
_MARGIN, _AMID = 0.045, 0.35
_SHORT = 0.01  # m: feet this close do not define a line
_THIN = 1e-4  # m2: collinear feet carry no load beside their line
_MOST = 0.05  # m: largest lean

GroundPoint = tuple[float, float]  # m forward and to the left


class Balance:
    """Inverted-pendulum model of the body over its feet.

    ``x``, ``y``: offset (m) of the body's centre forward and to the left. ``speed``: its rate of change, m/s.
    ``place``: centre of pressure on the ground.
    """

    def __init__(self) -> None:
        self.x = self.y = 0.0
        self.speed = self.place = (0.0, 0.0)
        self._sway = self._lean = (0.0, 0.0)

    def push(self, height: float) -> GroundPoint:
        """Return the ground's push forward and to the left, as shares of the body's weight."""
        return (self._sway[0] - self.place[0]) / height, (self._sway[1] - self.place[1]) / height

    def step(
        self,
        dt: float,
        height: float,
        place: GroundPoint,
        goal: GroundPoint,
        *,
        left: float,
        pull: GroundPoint,
    ) -> None:
        """Advance by ``dt`` seconds.

        The centre of pressure is at ``place`` for another ``left`` seconds; after that the body is to move as
        if it came to rest at ``goal``. ``pull``: acceleration of the body, m/s2.
        """
        rate, reach = math.sqrt(GRAVITY / height), height / GRAVITY
        (sway_x, sway_y), (lean_x, lean_y), (on_x, on_y) = self._sway, self._lean, self.place
        far, share = math.exp(-rate * left), min(1.0, rate * dt)
        sway_x += (place[0] + (goal[0] - place[0]) * far - sway_x) * share
        sway_y += (place[1] + (goal[1] - place[1]) * far - sway_y) * share
        share = min(1.0, dt / _LEAN_TIME)
        lean_x += (max(-_MOST, min(_MOST, pull[0] * reach)) - lean_x) * share
        lean_y += (max(-_MOST, min(_MOST, pull[1] * reach)) - lean_y) * share
        share = min(1.0, dt / _SHIFT_TIME)
        self.place = on_x + (place[0] - on_x) * share, on_y + (place[1] - on_y) * share
        self._sway, self._lean = (sway_x, sway_y), (lean_x, lean_y)
        x, y = sway_x + lean_x, sway_y + lean_y
        self.speed = (x - self.x) / dt, (y - self.y) / dt
        self.x, self.y = x, y


def inside(place: GroundPoint, start: LegPoint, end: LegPoint, third: LegPoint) -> GroundPoint:
    """Return the place, moved to the third foot's side of the line between two if needed, with a margin."""
    line_x, line_y = end[0] - start[0], end[1] - start[1]
    long = math.hypot(line_x, line_y)
    if long < _SHORT:
        return place
    out_x, out_y = -line_y / long, line_x / long
    high = (third[0] - start[0]) * out_x + (third[1] - start[1]) * out_y
    if high < 0:
        out_x, out_y, high = -out_x, -out_y, -high
    margin = min(_MARGIN, high * _AMID)
    missing = margin - (place[0] - start[0]) * out_x - (place[1] - start[1]) * out_y
    return (place[0] + out_x * missing, place[1] + out_y * missing) if missing > 0 else place


def loads(feet: Sequence[LegPoint], stance: Sequence[bool], place: GroundPoint) -> list[float]:
    """Return the share of the weight on each foot for this centre of pressure; 0 for feet in the air."""
    count, mean_x, mean_y, xx, yy, xy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for (x, y, _), stands in zip(feet, stance, strict=True):
        if stands:
            count, mean_x, mean_y = count + 1, mean_x + x, mean_y + y
            xx, yy, xy = xx + x * x, yy + y * y, xy + x * y
    even = 1.0 / count
    mean_x, mean_y = mean_x * even, mean_y * even
    xx, yy, xy = (
        xx - count * mean_x * mean_x + _THIN,
        yy - count * mean_y * mean_y + _THIN,
        xy - count * mean_x * mean_y,
    )
    off_x, off_y, under = place[0] - mean_x, place[1] - mean_y, xx * yy - xy * xy
    along, across = (off_x * yy - off_y * xy) / under, (off_y * xx - off_x * xy) / under
    even -= along * mean_x + across * mean_y
    shares = [
        even + along * x + across * y if stands else 0.0
        for (x, y, _), stands in zip(feet, stance, strict=True)
    ]
    if min(shares) >= 0.0:
        return shares
    whole = sum([share for share in shares if share > 0.0])
    return [max(0.0, share / whole) for share in shares]
