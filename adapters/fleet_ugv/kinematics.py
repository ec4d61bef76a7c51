"""From a body velocity to wheels and back; pure. Inside the limits, forward undoes inverse.

Beyond a limit, both wheels are scaled together, so that the robot keeps to its curve and only slows down.
"""

from __future__ import annotations

import math

import msgspec

from fleet import Refused, Vector3, Velocity
from fleet_ugv.model import Motion, Steering, Wheels

STILL = 1e-6  # m/s and rad/s below which nothing is asked


class Differential(msgspec.Struct, frozen=True):
    """Two driven sides. ``track`` is the effective one (m), wider than the drawing's on a skid-steer base.

    ``fastest``: the most that one side is told, m/s. ``left`` and ``right``: metres that a side goes when it
    is told one.
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
        """Return how fast (m/s over the ground) the faster side goes: a turn on the spot counts as well."""
        return abs(velocity.linear.x) + abs(velocity.yaw_rate) * self.track / 2

    def forward(self, motion: Motion) -> Velocity:
        """Return the body velocity of wheel speeds."""
        assert isinstance(motion, Wheels)
        left, right = motion.left * self.left, motion.right * self.right
        return Velocity(Vector3((left + right) / 2), (right - left) / self.track)


class Ackermann(msgspec.Struct, frozen=True):
    """A driven rear axle and steered front wheels.

    ``wheelbase``: m between the axles; ``sharpest``: rad to either side; ``fastest``: the most that it is
    told, m/s; ``scale``: metres that it goes when it is told one.
    """

    wheelbase: float
    sharpest: float
    fastest: float
    scale: float = 1.0

    def slowest(self, yaw_rate: float) -> float:
        """Return the least speed (m/s) at which the robot turns this fast (rad/s)."""
        return abs(yaw_rate) * self.wheelbase / math.tan(self.sharpest)

    def inverse(self, velocity: Velocity) -> Steering:
        """Return speed and steering; a curve that is too tight becomes the tightest.

        Raises Refused for a turn on the spot, which such a robot cannot make.
        """
        speed, yaw_rate = velocity.linear.x, velocity.yaw_rate
        if abs(speed) < STILL:
            if abs(yaw_rate) < STILL:
                return Steering()
            raise Refused("a robot that steers cannot turn on the spot", hint="let it roll as well")
        angle = math.atan(self.wheelbase * yaw_rate / speed)
        angle = min(max(angle, -self.sharpest), self.sharpest)
        return Steering(min(max(speed / self.scale, -self.fastest), self.fastest), angle)

    def fastest_wheel(self, velocity: Velocity) -> float:
        """Return how fast (m/s) the driven axle goes."""
        return abs(velocity.linear.x)

    def forward(self, motion: Motion) -> Velocity:
        """Return the body velocity of a speed and a steering angle."""
        assert isinstance(motion, Steering)
        speed = motion.speed * self.scale
        return Velocity(Vector3(speed), speed * math.tan(motion.angle) / self.wheelbase)


Kinematics = Differential | Ackermann
