"""Interface between simulated drives and physics, and the kinematic world, which needs no engine.

The kinematic body stands on its lowest feet and never falls: for tests and for computers without MuJoCo.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from fleet import Quaternion, Vector3, quaternion_from_yaw
from fleet_quadruped.body.legs import LegPoint
from fleet_quadruped.body.measured import MeasuredImu
from fleet_quadruped.body.odometry import body_twist
from fleet_quadruped.robot.description import DogDescription, leg_angles

GRAVITY = 9.81  # m/s2
_LAG = 0.01  # s: lag of a joint behind its target
_GROUNDED = 0.008  # m above the lowest foot that counts as standing


@dataclass(slots=True)
class SimMotor:
    """One joint between its drive and the world: rad, rad/s, N m of the joint.

    The drive sets the second half: torque = kp (target - angle) + kd (target_speed - speed) + feed; the
    target moves by ``slope`` (rad/s), which is how a drive interpolates.
    """

    angle: float = 0.0
    speed: float = 0.0
    torque: float = 0.0
    kp: float = 0.0
    kd: float = 0.0
    target: float = 0.0
    target_speed: float = 0.0
    feed: float = 0.0
    slope: float = 0.0


class World(Protocol):
    """A body with twelve motors."""

    @property
    def motors(self) -> Sequence[SimMotor]:
        """The motors in the order of ``JOINTS``."""

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds; called more often than ``measure``."""

    def measure(self) -> None:
        """Update the measurements of the motors, and the body."""

    def imu(self) -> MeasuredImu:
        """Return the measurement of an ideal IMU in the body."""

    def place(self) -> LegPoint:
        """Return the position of the body, m."""


class KinematicWorld:
    """World of joints that follow their targets with a lag, and feet that do not slip."""

    def __init__(self, dog: DogDescription) -> None:
        self._dog = dog
        self.motors = [SimMotor(angle=angle, target=angle) for angle in dog.posture(dog.poses.fold)]
        self._x = self._y = self._yaw = 0.0
        self._turn = self._passed = 0.0
        self._feet = self._all_feet()

    def step(self, dt: float) -> None:
        """Move the joints."""
        self._passed += dt
        share = 1.0 - math.exp(-dt / _LAG)
        for motor, joint in zip(self.motors, self._dog.all_joints, strict=True):
            before = motor.angle
            if motor.kp > 0:
                most = joint.kind.velocity * dt
                motor.target += motor.slope * dt
                motor.angle += max(-most, min(most, (motor.target - motor.angle) * share))
            motor.speed = (motor.angle - before) / dt
            motor.torque = motor.feed if motor.kp > 0 else 0.0

    def measure(self) -> None:
        """Move the body over the feet that stood since the last call."""
        dt, self._passed = self._passed, 0.0
        if dt == 0.0:
            return
        old, self._feet = self._feet, self._all_feet()
        lowest = min(foot[2] for foot in self._feet)
        standing = [
            (now[0], now[1], (now[0] - then[0]) / dt, (now[1] - then[1]) / dt)
            for then, now in zip(old, self._feet, strict=True)
            if now[2] < lowest + _GROUNDED
        ]
        twist = body_twist(standing, None)
        self._turn = twist.turn
        cos, sin = math.cos(self._yaw), math.sin(self._yaw)
        self._x += (cos * twist.x - sin * twist.y) * dt
        self._y += (sin * twist.x + cos * twist.y) * dt
        self._yaw += twist.turn * dt

    def imu(self) -> MeasuredImu:
        """Return a level body with its turn rate."""
        rotation: Quaternion = quaternion_from_yaw(self._yaw)
        return MeasuredImu(rotation, Vector3(0.0, 0.0, self._turn), Vector3(0.0, 0.0, GRAVITY))

    def place(self) -> LegPoint:
        """Return the position of the body."""
        return self._x, self._y, self._dog.geometry.foot_radius - min(foot[2] for foot in self._feet)

    def _all_feet(self) -> list[LegPoint]:
        posture = tuple(motor.angle for motor in self.motors)
        feet = []
        for number, leg in enumerate(self._dog.legs):
            x, y, z = leg.foot(leg_angles(posture, number))
            feet.append((leg.x + x, leg.y + y, z))
        return feet
