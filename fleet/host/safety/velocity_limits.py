"""Velocity limits: keep the direction, reduce the magnitude."""

from __future__ import annotations

from fleet.model.geometry import Vector3, Velocity
from fleet.robot_config import Limits


def clamp(velocity: Velocity, limits: Limits) -> Velocity:
    """Return the velocity within ``limits``; horizontal, vertical and yaw are limited separately."""
    linear = velocity.linear
    level = _scale(linear.horizontal(), limits.speed)
    climb = _scale(linear.z, limits.vertical_speed)
    turn = _scale(velocity.yaw_rate, limits.yaw_rate)
    if level == climb == turn == 1.0:
        return velocity
    scaled = Vector3(linear.x * level, linear.y * level, linear.z * climb)
    return Velocity(scaled, velocity.yaw_rate * turn, velocity.gait)


def _scale(value: float, limit: float | None) -> float:
    """Return the factor that brings the magnitude of ``value`` to at most ``limit``."""
    return 1.0 if limit is None or -limit <= value <= limit else limit / abs(value)
