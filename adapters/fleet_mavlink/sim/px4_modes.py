"""PX4's flight modes: main and sub mode packed into custom_mode."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import Idle, Land, Manoeuvre, Return, Sink, hold
from fleet_mavlink.sim.mission_flight import MissionManoeuvre
from fleet_mavlink.sim.modes import AUTO_BASE, MANUAL_BASE, FlightMode
from fleet_mavlink.sim.px4_takeoff import Px4Takeoff

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_DESCENT = 0.8  # m/s of the fail-safe in a manual mode without stick input
_CONE_MIN = 10.0  # m above home, lowest height of RTL


def _sink(_pilot: Autopilot) -> Manoeuvre:
    return Sink(_DESCENT)


def _fall(_pilot: Autopilot) -> Manoeuvre:
    return Idle()


def _home(pilot: Autopilot) -> Manoeuvre:
    """Climb into a cone of 45 degrees around home, at most RTL_RETURN_ALT above it."""
    north, east, _ = pilot.home.ned()
    flat = max(abs(pilot.body.north - north), abs(pilot.body.east - east))
    height = min(pilot.params["RTL_RETURN_ALT"], max(_CONE_MIN, flat + _CONE_MIN))
    return Return(pilot, height, 0.0)


def _take_off(pilot: Autopilot) -> Manoeuvre:
    """Climb MIS_TAKEOFF_ALT if no command gave a height."""
    return Px4Takeoff(pilot, pilot.geo()[2] + pilot.params["MIS_TAKEOFF_ALT"])


def _auto(sub: int) -> int:
    return sub << 24 | 4 << 16


_ALL = (
    FlightMode("MANUAL", 1 << 16, _sink, MANUAL_BASE, position=False, armable=False),
    FlightMode("ALTCTL", 2 << 16, _sink, MANUAL_BASE, position=False, armable=False),
    FlightMode("POSCTL", 3 << 16, _sink, MANUAL_BASE, armable=False),
    FlightMode("ORBIT", 1 << 24 | 3 << 16, hold, AUTO_BASE),
    FlightMode("OFFBOARD", 6 << 16, hold, AUTO_BASE),
    FlightMode("STABILIZED", 7 << 16, _sink, MANUAL_BASE, position=False, armable=False),
    FlightMode("TERMINATION", 10 << 16, _fall, AUTO_BASE, position=False, armable=False),
    FlightMode("TAKEOFF", _auto(2), _take_off, AUTO_BASE),
    FlightMode("LOITER", _auto(3), hold, AUTO_BASE),
    FlightMode("MISSION", _auto(4), MissionManoeuvre, AUTO_BASE),
    FlightMode("RTL", _auto(5), _home, AUTO_BASE, armable=False),
    FlightMode("LAND", _auto(6), Land, AUTO_BASE, position=False, armable=False),
    FlightMode("PRECLAND", _auto(9), Land, AUTO_BASE, armable=False),
)
MODES = {mode.name: mode for mode in _ALL}
MODES_BY_NUMBER = {mode.custom: mode for mode in _ALL}
