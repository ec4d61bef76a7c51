"""ArduCopter's flight modes. Without a stick input the manual ones descend."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import Land, Manoeuvre, Return, Sink, hold
from fleet_mavlink.sim.mission_flight import MissionManoeuvre
from fleet_mavlink.sim.modes import GUIDED_BASE, MANUAL_BASE, FlightMode

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

_STICK_AT_MINIMUM = 2.5  # m/s down


def _sink(_pilot: Autopilot) -> Manoeuvre:
    return Sink(_STICK_AT_MINIMUM)


def _home(pilot: Autopilot) -> Manoeuvre:
    """Return home; RTL_ALT is in centimetres, RTL_LOIT_TIME in milliseconds."""
    return Return(pilot, pilot.params["RTL_ALT"] / 100, pilot.params["RTL_LOIT_TIME"] / 1000)


_ALL = (
    FlightMode("STABILIZE", 0, _sink, MANUAL_BASE, position=False),
    FlightMode("ALT_HOLD", 2, _sink, MANUAL_BASE, position=False),
    FlightMode("AUTO", 3, MissionManoeuvre, GUIDED_BASE),
    FlightMode("GUIDED", 4, hold, GUIDED_BASE),
    FlightMode("LOITER", 5, _sink, GUIDED_BASE),
    FlightMode("RTL", 6, _home, GUIDED_BASE, armable=False),
    FlightMode("LAND", 9, Land, GUIDED_BASE, position=False, armable=False),
    FlightMode("POSHOLD", 16, _sink, GUIDED_BASE),
    FlightMode("BRAKE", 17, hold, GUIDED_BASE, armable=False),
    FlightMode("SMART_RTL", 21, _home, GUIDED_BASE, armable=False),
)
MODES = {mode.name: mode for mode in _ALL}
