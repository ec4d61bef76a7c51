"""GUIDED of ArduRover: drives by setpoints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from fleet_mavlink.sim.manoeuvres import Manoeuvre
from fleet_mavlink.sim.rover_moves import BRAKED, Coast, DriveAtSpeed, DriveToPosition
from fleet_mavlink.sim.setpoints import ReceivedSetpoint, SetpointControl, setpoint_of

if TYPE_CHECKING:
    from fleet_mavlink.sim.rover import SimArduRover

_BODY_FRAMES = frozenset({8, 9})
_RELATIVE_FRAMES = frozenset({3, 6, 10, 11})


class RoverGuided(SetpointControl):
    """Drives by setpoints of one ArduRover."""

    def __init__(self, pilot: SimArduRover) -> None:
        self._pilot = pilot

    def receive(self, message: Any) -> None:
        """Follow a setpoint in GUIDED; ignore it silently otherwise."""
        pilot = self._pilot
        if pilot.mode.name == "GUIDED" and pilot.armed:
            pilot.manoeuvre = self._manoeuvre(setpoint_of(message))

    def _manoeuvre(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the drive: with a yaw rate by the sign of the forward speed, else by turning the nose."""
        pilot = self._pilot
        if setpoint.position is not None:
            return self._to_place(setpoint)
        vx, vy, _ = setpoint.velocity or (0.0, 0.0, 0.0)
        rate = setpoint.turn_rate
        speed = min(math.hypot(vx, vy), pilot.params["WP_SPEED"])
        if not setpoint.finite or (speed == 0.0 and not rate):
            return Coast(BRAKED)
        until = pilot.time + pilot.params["GUID_TIMEOUT"]
        if rate is not None:
            return DriveAtSpeed(math.copysign(speed, vx), None, rate, until)
        heading = math.atan2(vy, vx) + (pilot.body.heading if setpoint.frame in _BODY_FRAMES else 0.0)
        return DriveAtSpeed(speed, heading, 0.0, until)

    def _to_place(self, setpoint: ReceivedSetpoint) -> Manoeuvre:
        """Return the drive to a position: global above home, or local."""
        x, y, z = setpoint.position or (0.0, 0.0, 0.0)
        if setpoint.frame in _RELATIVE_FRAMES:
            x, y, _ = self._pilot.frame.ned_of(x, y, z)
        return DriveToPosition(x, y)
