"""Kinematics: body velocity to wheel speeds and back; pure. Within the limits, forward inverts inverse.

Beyond a limit, both wheels are scaled together, so that the robot follows the same curve, only slower.
"""

from __future__ import annotations

import math

import msgspec

from fleet import Refused, Vector3, Velocity
from fleet_ugv.model import AckermannCommand, Motion, Wheels

STILL = 1e-6  # m/s and rad/s below which nothing is asked


class Differential(msgspec.Struct, frozen=True):
    """Two driven sides. ``track`` is the effective one (m), wider than the geometric one when skid-steered.

    ``fastest``: largest commanded speed of a side, m/s. ``left`` and ``right``: metres that a side moves per
    commanded metre.
    """

    track: float
    fastest: float
    left: float = 1.0
    right: float = 1.0

    def inverse(self, velocity: Velocity) -> Wheels:
        """Return the wheel speeds; a sideways part is dropped."""
        turn = velocity.yaw_rate * self.track / 2
        left, right = (velocity.linear.x - turn) / self.left, (velocity.linear.x + turn) / self.right
        scale = min(1.0, self.fastest / max(abs(left), abs(right), STILL))
        return Wheels(left * scale, right * scale)

    def fastest_wheel(self, velocity: Velocity) -> float:
        """Return the ground speed of the faster side, m/s; also for a turn on the spot."""
        return abs(velocity.linear.x) + abs(velocity.yaw_rate) * self.track / 2

    def forward(self, motion: Motion) -> Velocity:
        """Return the body velocity of wheel speeds."""
        assert isinstance(motion, Wheels)
        left, right = motion.left * self.left, motion.right * self.right
        return Velocity(Vector3((left + right) / 2), (right - left) / self.track)


class Ackermann(msgspec.Struct, frozen=True):
    """A driven rear axle and steered front wheels.

    ``wheelbase``: m between the axles; ``sharpest``: largest steering angle, rad to either side; ``fastest``:
    largest commanded speed, m/s; ``scale``: metres that it moves per commanded metre.
    """

    wheelbase: float
    sharpest: float
    fastest: float
    scale: float = 1.0

    def slowest(self, yaw_rate: float) -> float:
        """Return the least speed (m/s) at which the robot turns this fast (rad/s)."""
        return abs(yaw_rate) * self.wheelbase / math.tan(self.sharpest)

    def inverse(self, velocity: Velocity) -> AckermannCommand:
        """Return speed and steering; a curve that is too tight becomes the tightest possible one.

        Raises Refused for a turn on the spot, which this kind of robot cannot make.
        """
        speed, yaw_rate = velocity.linear.x, velocity.yaw_rate
        if abs(speed) < STILL:
            if abs(yaw_rate) < STILL:
                return AckermannCommand()
            raise Refused("a robot that steers cannot turn on the spot", hint="let it roll as well")
        angle = math.atan(self.wheelbase * yaw_rate / speed)
        angle = min(max(angle, -self.sharpest), self.sharpest)
        return AckermannCommand(min(max(speed / self.scale, -self.fastest), self.fastest), angle)

    def fastest_wheel(self, velocity: Velocity) -> float:
        """Return the speed of the driven axle, m/s."""
        return abs(velocity.linear.x)

    def forward(self, motion: Motion) -> Velocity:
        """Return the body velocity of a speed and a steering angle."""
        assert isinstance(motion, AckermannCommand)
        speed = motion.speed * self.scale
        return Velocity(Vector3(speed), speed * math.tan(motion.angle) / self.wheelbase)


Kinematics = Differential | Ackermann
