"""Position and velocity targets, decoded from SET_POSITION_TARGET_LOCAL_NED and _GLOBAL_INT."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

_POSITION, _VELOCITY, _FORCE = 0x007, 0x038, 0x200
_YAW, _YAW_RATE = 0x400, 0x800

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ReceivedSetpoint:
    """A decoded setpoint; None for fields that its mask ignores. Axes as in its frame.

    ``force``: the acceleration field is marked as a force, which no autopilot here supports.
    """

    frame: int
    position: Triple | None
    velocity: Triple | None
    heading: float | None
    turn_rate: float | None
    force: bool

    @property
    def finite(self) -> bool:
        """True if all used numbers are finite, and the speeds plausible."""
        numbers = [*(self.position or ()), *(self.velocity or ()), self.heading or 0.0, self.turn_rate or 0.0]
        return all(math.isfinite(number) for number in numbers) and all(
            abs(speed) <= 1000.0 for speed in self.velocity or ()
        )


class SetpointControl(ABC):
    """Flight by setpoints: GUIDED or OFFBOARD of one vehicle."""

    @abstractmethod
    def receive(self, message: Any) -> None:
        """Obey or ignore SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT."""


def setpoint_of(message: Any) -> ReceivedSetpoint:
    """Return the setpoint of a message of either kind; a global position is latitude, longitude, altitude."""
    mask = message.type_mask
    if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT":
        position = (message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
    else:
        position = (message.x, message.y, message.z)
    return ReceivedSetpoint(
        frame=message.coordinate_frame,
        position=None if mask & _POSITION else position,
        velocity=None if mask & _VELOCITY else (message.vx, message.vy, message.vz),
        heading=None if mask & _YAW else message.yaw,
        turn_rate=None if mask & _YAW_RATE else message.yaw_rate,
        force=bool(mask & _FORCE),
    )


def turned(vector: Triple, heading: float) -> Triple:
    """Rotate a level body vector (forward, right, down) to north, east, down."""
    cos, sin = math.cos(heading), math.sin(heading)
    x, y, z = vector
    return cos * x - sin * y, sin * x + cos * y, z
