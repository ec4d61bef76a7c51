"""Where the body is over its feet, so that what it presses on stays amid those that stand.

A body on legs is a pendulum upside down: at height h it falls away from the point on which it presses, and at
each acceleration a it presses h/g a behind its centre. Both are known beforehand, because the gait and the
wanted velocity are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fleet_quadruped.body.legs import Point

GRAVITY = 9.81  # m/s2
_LEAN_TIME = 0.1  # s in which the body leans into an acceleration
_SHIFT_TIME = 0.04  # s in which the weight goes from foot to foot
_MARGIN, _AMID = (
    0.045,
    0.35,
)  # m from the line between two feet to where it presses, or of the way to the third
_SHORT = 0.01  # m: feet so near each other have no line between them
_THIN = 1e-4  # m2: feet in a line bear nothing beside it
_MOST = 0.05  # m that it leans

Place = tuple[float, float]  # m ahead and to the left


class Balance:
    """``x``, ``y``: how far (m) the body's centre is ahead and to the left of its place over the feet.

    ``speed``: how fast (m/s) this changes. ``place``: where it presses on the ground.
    """

    def __init__(self) -> None:
        self.x = self.y = 0.0
        self.speed = self.place = (0.0, 0.0)
        self._sway_x = self._sway_y = 0.0
        self._lean_x = self._lean_y = 0.0

    def push(self, height: float) -> tuple[float, float]:
        """Return how the ground pushes it, ahead and to the left, as shares of its weight."""
        return (self._sway_x - self.place[0]) / height, (self._sway_y - self.place[1]) / height

    def step(self, dt: float, height: float, place: Place, goal: Place, *, left: float, pull: Place) -> None:
        """Move on by ``dt`` seconds.

        The body presses on ``place`` for ``left`` seconds more, and is to move then as if it were to come to
        rest at ``goal``. ``pull``: its acceleration, m/s2.
        """
        rate = math.sqrt(GRAVITY / height)
        near, share = 1.0 - math.exp(-rate * left), min(1.0, rate * dt)
        self._sway_x += (goal[0] + (place[0] - goal[0]) * near - self._sway_x) * share
        self._sway_y += (goal[1] + (place[1] - goal[1]) * near - self._sway_y) * share
        share = min(1.0, dt / _SHIFT_TIME)
        was_x, was_y = self.place
        self.place = was_x + (place[0] - was_x) * share, was_y + (place[1] - was_y) * share
        share, reach = min(1.0, dt / _LEAN_TIME), height / GRAVITY
        self._lean_x += (_within(pull[0] * reach) - self._lean_x) * share
        self._lean_y += (_within(pull[1] * reach) - self._lean_y) * share
        x, y = self._sway_x + self._lean_x, self._sway_y + self._lean_y
        self.speed = (x - self.x) / dt, (y - self.y) / dt
        self.x, self.y = x, y


def _within(value: float) -> float:
    """Return how far it leans."""
    return max(-_MOST, min(_MOST, value))


def inside(place: Place, start: Point, end: Point, third: Point) -> Place:
    """Return the place, or the nearest one that is well on the third foot's side of a line between two."""
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


def loads(feet: Sequence[Point], stance: Sequence[bool], place: Place) -> list[float]:
    """Return the share of the weight on each foot so that together they press on a place; 0 in the air."""
    standing = [foot for foot, stands in zip(feet, stance, strict=True) if stands]
    count = len(standing)
    mean_x = sum([foot[0] for foot in standing]) / count
    mean_y = sum([foot[1] for foot in standing]) / count
    xx = yy = _THIN
    xy = 0.0
    for x, y, _ in standing:
        xx += (x - mean_x) ** 2
        yy += (y - mean_y) ** 2
        xy += (x - mean_x) * (y - mean_y)
    off_x, off_y = place[0] - mean_x, place[1] - mean_y
    under = xx * yy - xy * xy
    along, across = (off_x * yy - off_y * xy) / under, (off_y * xx - off_x * xy) / under
    shares = [
        max(0.0, 1 / count + along * (x - mean_x) + across * (y - mean_y)) if stands else 0.0
        for (x, y, _), stands in zip(feet, stance, strict=True)
    ]
    whole = sum(shares)
    return [share / whole for share in shares]
