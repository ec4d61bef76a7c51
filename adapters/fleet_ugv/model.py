"""Values between a codec and the adapter: wheel commands, and feedback of a base.

Metres, radians, seconds, volts; x forward, yaw counter-clockwise. None: the base does not report the value.
"""

from __future__ import annotations

import msgspec

from fleet import Vector3


class Wheels(msgspec.Struct, frozen=True):
    """Speeds of the two sides over the ground, m/s."""

    left: float = 0.0
    right: float = 0.0


class AckermannCommand(msgspec.Struct, frozen=True):
    """Speed of the rear axle, m/s, and the angle of the front wheels, rad, left positive."""

    speed: float = 0.0
    angle: float = 0.0


Motion = Wheels | AckermannCommand


class Feedback(msgspec.Struct, frozen=True):
    """One round of measurements.

    ``distances``: signed distances of the left and the right side since the board started, m; ``speeds``:
    m/s. ``yaw``: the base's own heading, rad. ``pan`` and ``tilt``: the camera's angles, rad.
    """

    distances: tuple[float, float] | None = None
    speeds: tuple[float, float] | None = None
    gyro: Vector3 | None = None
    accel: Vector3 | None = None
    yaw: float | None = None
    voltage: float | None = None
    temperature: float | None = None
    pan: float | None = None
    tilt: float | None = None


class Confirmed(msgspec.Struct, frozen=True):
    """The board has confirmed its dead-man's time."""


class BaseFault(msgspec.Struct, frozen=True):
    """A fault reported by the base, in words."""

    text: str


UgvEvent = Feedback | Confirmed | BaseFault
