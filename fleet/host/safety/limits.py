"""Velocities kept within a robot's limits: the direction stays, the length shrinks."""

from __future__ import annotations

from fleet.model.geometry import Vector3, Velocity
from fleet.robot_config import Limits


def clamp(velocity: Velocity, limits: Limits) -> Velocity:
    """Return the velocity within ``limits``; horizontal, vertical and yaw each on their own."""
    linear = velocity.linear
    level, climb, turn = linear.horizontal(), abs(linear.z), abs(velocity.yaw_rate)
    if (
        (limits.speed is None or level <= limits.speed)
        and (limits.vertical_speed is None or climb <= limits.vertical_speed)
        and (limits.yaw_rate is None or turn <= limits.yaw_rate)
    ):
        return velocity
    scale = _scale(level, limits.speed)
    vertical = linear.z * _scale(climb, limits.vertical_speed)
    yaw_rate = velocity.yaw_rate * _scale(turn, limits.yaw_rate)
    return Velocity(Vector3(linear.x * scale, linear.y * scale, vertical), yaw_rate, velocity.gait)


def _scale(length: float, limit: float | None) -> float:
    """Return the factor that brings ``length`` to at most ``limit``."""
    return 1.0 if limit is None or length <= limit else limit / length
