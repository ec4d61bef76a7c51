"""Measurements of the body in one cycle, and the targets of its joints."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec

from fleet import Quaternion, Vector3
from fleet_quadruped.robot.names import Twelve


class MeasuredImu(NamedTuple):
    """Orientation (body to world), rates (rad/s) and acceleration (m/s2) in the body frame."""

    rotation: Quaternion
    gyro: Vector3
    accel: Vector3

    @property
    def roll(self) -> float:
        """Radians, left side up positive."""
        w, x, y, z = self.rotation.w, self.rotation.x, self.rotation.y, self.rotation.z
        return math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))

    @property
    def pitch(self) -> float:
        """Radians, nose down positive."""
        w, x, y, z = self.rotation.w, self.rotation.x, self.rotation.y, self.rotation.z
        return math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))

    @property
    def up(self) -> float:
        """Upward component of the body's z axis: 1 upright, -1 on its back."""
        return 1 - 2 * (self.rotation.x**2 + self.rotation.y**2)

    @property
    def tilt(self) -> float:
        """Angle between the body's z axis and the vertical, rad."""
        return math.acos(max(-1.0, min(1.0, self.up)))


class BodyMeasurement(msgspec.Struct, frozen=True, gc=False):
    """Joint angles (rad), speeds (rad/s), and a fresh measurement of the IMU if there is one.

    ``braked``: why the robot cannot be lowered now (a drive brakes on its own, a bus is silent); else empty.
    """

    angles: Twelve
    speeds: Twelve
    imu: MeasuredImu | None
    braked: str = ""


class Targets(NamedTuple):
    """Targets of the joints: angle (rad), speed (rad/s) and feed-forward torque (N m)."""

    angles: Twelve
    speeds: Twelve
    torques: Twelve


ZEROS: Twelve = (0.0,) * 12
