"""Leg odometry: motion of the body, computed from the standing feet.

A standing foot rolls on the ground, so its radius counts: ignoring it makes the speed 7 % too low.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fleet import Vector3, wrap_angle
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.legs import DogLeg, Reached
from fleet_quadruped.body.measured import BodyMeasurement
from fleet_quadruped.robot.description import leg_angles

Planar = tuple[float, float, float, float]  # foot position x, y (m) and velocity x, y (m/s), body frame


class LegOdometry:
    """Position since the start (m), heading (rad) and velocity from the standing feet.

    ``twist`` is low-pass filtered over ``smooth`` s. The heading is that of the IMU, so that position and
    orientation are in one frame. ``reached``: foot position and Jacobian of the feet that carried weight in
    this cycle, by leg number.
    """

    def __init__(self, legs: Sequence[DogLeg], foot_radius: float, smooth: float = 0.1) -> None:
        self._legs = legs
        self._radius = foot_radius
        self._smooth = smooth
        self.x = self.y = self.yaw = 0.0
        self.twist = Twist()
        self.reached: dict[int, Reached] = {}

    def update(
        self,
        dt: float,
        sense: BodyMeasurement,
        loads: Sequence[float],
        sway: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Advance by the motion of the standing feet, each weighted by its load.

        ``sway``: speed (m/s) of the body over its feet within the gait, which is not part of its twist.
        """
        gyro = sense.imu.gyro if sense.imu else None
        self.reached.clear()
        standing = [self._motion(number, sense, gyro) for number in range(4) if loads[number]]
        if not standing:
            return
        seen = body_twist(standing, None if gyro is None else gyro.z, [load for load in loads if load])
        share = min(1.0, dt / self._smooth)
        old = self.twist
        self.twist = Twist(
            old.x + (seen.x - sway[0] - old.x) * share,
            old.y + (seen.y - sway[1] - old.y) * share,
            old.turn + (seen.turn - old.turn) * share,
        )
        self._turn(dt, sense, seen.turn)
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        self.x += (cos * seen.x - sin * seen.y) * dt
        self.y += (sin * seen.x + cos * seen.y) * dt

    def _turn(self, dt: float, sense: BodyMeasurement, rate: float) -> None:
        """Take the heading from the IMU; without one, integrate the rate."""
        imu = sense.imu
        self.yaw = wrap_angle(self.yaw + rate * dt) if imu is None else imu.rotation.yaw

    def _motion(self, number: int, sense: BodyMeasurement, gyro: Vector3 | None) -> Planar:
        """Return the position of a foot, and the velocity of its contact point caused by the joints."""
        leg = self._legs[number]
        angles = leg_angles(sense.angles, number)
        out, swing, bend = leg_angles(sense.speeds, number)
        (x, y, z), (abad, hip, knee) = self.reached[number] = leg.reach(angles)
        moved_x = abad[0] * out + hip[0] * swing + knee[0] * bend
        moved_y = abad[1] * out + hip[1] * swing + knee[1] * bend
        about_x, about_y = out, (swing + bend) * math.cos(angles[0])
        if gyro is not None:
            about_x += gyro.x
            about_y += gyro.y
            moved_x += gyro.y * z
            moved_y -= gyro.x * z
        return leg.x + x, leg.y + y, moved_x - self._radius * about_y, moved_y + self._radius * about_x


def body_twist(feet: Sequence[Planar], turn: float | None, loads: Sequence[float] = ()) -> Twist:
    """Return the body's velocity that keeps all standing feet at rest.

    Without a known turn rate it is fitted by least squares. Feet are weighted by their loads; without
    ``loads`` they count equally.
    """
    if turn is None:
        turn = _turn_of(feet)
    along = aside = whole = 0.0
    for (x, y, moved_x, moved_y), load in zip(feet, loads or [1.0] * len(feet), strict=True):
        along -= (moved_x - turn * y) * load
        aside -= (moved_y + turn * x) * load
        whole += load
    return Twist(along / whole, aside / whole, turn)


def _turn_of(feet: Sequence[Planar]) -> float:
    """Return the turn rate that fits the feet best; 0 for a single foot."""
    count = len(feet)
    mean = [sum(foot[axis] for foot in feet) / count for axis in range(4)]
    across = spread = 0.0
    for foot in feet:
        x, y, moved_x, moved_y = (value - middle for value, middle in zip(foot, mean, strict=True))
        across += y * moved_x - x * moved_y
        spread += x * x + y * y
    return across / spread if spread > 1e-6 else 0.0
