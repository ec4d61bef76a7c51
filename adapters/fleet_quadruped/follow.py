"""Going to a place: a velocity towards it, sideways too; a pure function of where the dog is."""

from __future__ import annotations

import math
from typing import NamedTuple

from fleet import Vector3, Velocity
from fleet.model.geometry import wrap_angle

REACHED = 0.08  # m
TURNED = 0.1  # rad
_NEAR = 0.6  # m: closer, it walks sideways and backwards; farther, it turns to its goal first
_GAIN, _TURN_GAIN = 1.2, 1.5  # 1/s
_SLOWEST = 0.06  # m/s that still moves it


class Place(NamedTuple):
    """Where on the ground: m, rad; a heading of None is any."""

    x: float
    y: float
    yaw: float | None


def towards(
    here: Place, goal: Place, *, speed: float, strafe: float, turn: float, reached: float
) -> Velocity | None:
    """Return the velocity that leads to the goal; None when it is reached.

    ``speed``, ``strafe``, ``turn`` are the dog's limits, ``reached`` the distance (m) that is near enough.
    """
    yaw = here.yaw or 0.0
    dx, dy = goal.x - here.x, goal.y - here.y
    distance = math.hypot(dx, dy)
    if distance > _NEAR:
        error = wrap_angle(math.atan2(dy, dx) - yaw)
        forward = min(speed, _GAIN * distance) * max(0.0, math.cos(error)) if abs(error) < 0.7 else 0.0
        return Velocity(Vector3(forward), _within(_TURN_GAIN * error, turn))
    error = wrap_angle(goal.yaw - yaw) if goal.yaw is not None else 0.0
    if distance <= reached and abs(error) <= TURNED:
        return None
    pace = max(_SLOWEST, _GAIN * distance) / max(distance, 1e-6) if distance > reached / 2 else 0.0
    cos, sin = math.cos(yaw), math.sin(yaw)
    ahead, left = (cos * dx + sin * dy) * pace, (-sin * dx + cos * dy) * pace
    return Velocity(Vector3(_within(ahead, speed), _within(left, strafe)), _within(_TURN_GAIN * error, turn))


def _within(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
