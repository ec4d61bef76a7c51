"""From a wanted velocity to one that the machine can hold, no more suddenly than it may; pure."""

from __future__ import annotations

import math

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.robot.parts import Pace


def within(value: float, limit: float) -> float:
    """Return a value no farther from zero than the limit."""
    return -limit if value < -limit else limit if value > limit else value  # noqa: FURB136 - quicker than max, min


def limited(wanted: Twist, pace: Pace, share: float = 1.0) -> Twist:
    """Return a velocity that can be held, in the same direction; ``share`` of all limits is used.

    Zero for what is no velocity.
    """
    if not math.isfinite(wanted.x + wanted.y + wanted.turn):
        return Twist()
    over = math.hypot(wanted.x / pace.speed, wanted.y / pace.strafe, wanted.turn / pace.turn) / share
    slower = 1.0 / max(1.0, over)
    return Twist(wanted.x * slower, wanted.y * slower, wanted.turn * slower)


def ramped(now: Twist, goal: Twist, pace: Pace, dt: float) -> Twist:
    """Return the velocity after ``dt`` seconds on the way to a goal."""
    if now == goal:
        return goal
    most = pace.acceleration * dt
    return Twist(
        now.x + within(goal.x - now.x, most),
        now.y + within(goal.y - now.y, most),
        now.turn + within(goal.turn - now.turn, pace.turn_acceleration * dt),
    )
