"""ArduRover's modes. HOLD needs no position and coasts; LOITER brakes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import Manoeuvre
from fleet_mavlink.sim.modes import FlightMode
from fleet_mavlink.sim.rover_mission import DriveMission
from fleet_mavlink.sim.rover_moves import BRAKED, HELD, Coast, DriveToPosition

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_HOLD, _GUIDED, _MANUAL = 0x01, 0x09, 0x41  # base_mode


def _hold(_pilot: Autopilot) -> Manoeuvre:
    return Coast(HELD)


def _stay(_pilot: Autopilot) -> Manoeuvre:
    return Coast(0.0)


def _guided(_pilot: Autopilot) -> Manoeuvre:
    """Stop until a setpoint arrives. GUIDED again is no stop: a mode is not entered again."""
    return Coast(BRAKED)


def _home(pilot: Autopilot) -> Manoeuvre:
    """Drive home and stand there, armed."""
    north, east, _ = pilot.home.ned()
    return DriveToPosition(north, east)


_ALL = (
    FlightMode("MANUAL", 0, _hold, _MANUAL, position=False),
    FlightMode("HOLD", 4, _hold, _HOLD, position=False),
    FlightMode("LOITER", 5, _stay, _GUIDED),
    FlightMode("CIRCLE", 9, _stay, _GUIDED),
    FlightMode("AUTO", 10, DriveMission, _GUIDED),
    FlightMode("RTL", 11, _home, _GUIDED),
    FlightMode("GUIDED", 15, _guided, _GUIDED),
    FlightMode("INITIALISING", 16, _hold, _HOLD, position=False, armable=False),
)
MODES = {mode.name: mode for mode in _ALL}
