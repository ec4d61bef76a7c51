"""Motion laws of the follower: speed, direction, and limits of acceleration. Pure."""

from __future__ import annotations

import math

import msgspec

from fleet.host.follow.legs import FlatPoint
from fleet.model.geometry import Pose, Vector3, Velocity, rotate_to_world, wrap_angle

BRAKING = 0.25  # m/s2 with which the approach to the goal is planned
TURN_BRAKING = 1.5  # rad/s2
CREEP = 0.05  # m/s; slower motion is lost in the wheels' stiction
LEAST_TURN = 0.2  # rad/s; slower turns are lost as well
NO_LIMIT = 1.0  # m/s and rad/s for a robot that declares no limit


class MotionLimits(msgspec.Struct, frozen=True):
    """Limits of motion for a robot: m/s, rad/s, m/s2, rad/s2."""

    speed: float
    yaw_rate: float
    acceleration: float = 0.5
    yaw_acceleration: float = 3.0


def bearing(pose: Pose, target: FlatPoint, *, backwards: bool = False) -> float:
    """Return the angle from the robot's front (``backwards``: its back) to a point, left positive."""
    at = pose.position
    heading = pose.rotation.yaw + (math.pi if backwards else 0.0)
    return wrap_angle(math.atan2(target[1] - at.y, target[0] - at.x) - heading)


def distance(pose: Pose, target: FlatPoint) -> float:
    """Return the distance to a point in the plane, m."""
    return math.dist((pose.position.x, pose.position.y), target)


def turning(error: float, pace: MotionLimits) -> float:
    """Return a yaw rate that reduces a heading error and can still stop at zero error."""
    fastest = min(pace.yaw_rate, max(LEAST_TURN, math.sqrt(2 * TURN_BRAKING * abs(error)) * 0.6))
    return math.copysign(min(fastest, max(LEAST_TURN, 2.5 * abs(error))), error)


def approach(remaining: float, pace: MotionLimits) -> float:
    """Return the speed from which the robot can still stop within ``remaining`` metres."""
    return min(pace.speed, max(CREEP, min(math.sqrt(2 * BRAKING * remaining), 1.2 * remaining)))


def pursue(
    pose: Pose, target: FlatPoint, remaining: float, pace: MotionLimits, *, backwards: bool
) -> Velocity:
    """Return the velocity along the arc to a point (pure pursuit), slower within ``remaining`` metres."""
    error, apart = bearing(pose, target, backwards=backwards), max(distance(pose, target), 0.05)
    curvature = 2 * math.sin(error) / max(apart, 0.15)
    speed = approach(remaining, pace) * max(0.3, math.cos(error))
    speed = min(speed, pace.yaw_rate / max(abs(curvature), 1e-6))
    yaw_rate = min(max(speed * curvature, -pace.yaw_rate), pace.yaw_rate)
    return Velocity(Vector3(-speed if backwards else speed), yaw_rate)


def holonomic_velocity(
    pose: Pose, target: FlatPoint, remaining: float, yaw: float, pace: MotionLimits
) -> Velocity:
    """Return the velocity of a holonomic robot: straight to a point, turning on the remaining."""
    angle = bearing(pose, target)
    speed = approach(remaining, pace)
    error = wrap_angle(yaw - pose.rotation.yaw)
    yaw_rate = turning(error, pace) if abs(error) > 0.1 else 0.0
    return Velocity(rotate_to_world(Vector3(speed), angle), yaw_rate)


def ramp(now: Velocity, wanted: Velocity, pace: MotionLimits, elapsed: float) -> Velocity:
    """Return the velocity nearest to ``wanted`` that the limits of acceleration allow."""
    change = wanted.linear - now.linear
    most = pace.acceleration * elapsed
    if change.norm() > most:
        change = change.scaled(most / change.norm())
    turn = wanted.yaw_rate - now.yaw_rate
    most_turn = pace.yaw_acceleration * elapsed
    return Velocity(now.linear + change, now.yaw_rate + min(max(turn, -most_turn), most_turn))
