"""Limits of velocity and acceleration for a requested velocity; pure."""

from __future__ import annotations

import math

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.robot.parts import Pace


def within(value: float, limit: float) -> float:
    """Clamp a value to plus or minus the limit."""
    return -limit if value < -limit else limit if value > limit else value  # noqa: FURB136 - faster than min


def limited(wanted: Twist, pace: Pace, share: float = 1.0) -> Twist:
    """Return a velocity within the limits, in the same direction; ``share`` scales all limits.

    Zero for a velocity that is not finite.
    """
    if not math.isfinite(wanted.x + wanted.y + wanted.turn):
        return Twist()
    over = math.hypot(wanted.x / pace.speed, wanted.y / pace.strafe, wanted.turn / pace.turn) / share
    slower = 1.0 / max(1.0, over)
    return Twist(wanted.x * slower, wanted.y * slower, wanted.turn * slower)


def ramped(now: Twist, goal: Twist, pace: Pace, dt: float) -> Twist:
    """Return the velocity after ``dt`` seconds of acceleration towards a goal."""
    if now == goal:
        return goal
    most = pace.acceleration * dt
    return Twist(
        now.x + within(goal.x - now.x, most),
        now.y + within(goal.y - now.y, most),
        now.turn + within(goal.turn - now.turn, pace.turn_acceleration * dt),
    )
