"""ArduPlane's handlers of its commands; all others, also NAV_LAND, are UNSUPPORTED."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot_commands import COMMANDS as COPTERS
from fleet_mavlink.sim.autopilot import CommandHandler
from fleet_mavlink.sim.command_request import ACCEPTED, DENIED, FAILED, CommandRequest, whole
from fleet_mavlink.sim.message_output import INFO, WARNING
from fleet_mavlink.sim.plane_moves import CircleManoeuvre

if TYPE_CHECKING:
    from fleet_mavlink.sim.plane import SimArduPlane

_AIRSPEED, _DEFAULT = 0, -2.0  # DO_CHANGE_SPEED: airspeed type, and the value that resets it
_ABOVE_HOME = {0: 0.0, 5: 0.0, 3: 1.0, 6: 1.0}  # frames


def _arm(pilot: SimArduPlane, request: CommandRequest) -> int:
    """Arm like a copter, with other texts."""
    before = pilot.armed
    result = COPTERS[mav.MAV_CMD_COMPONENT_ARM_DISARM](pilot, request)
    if pilot.armed is not before:
        pilot.say(INFO, "Throttle armed" if pilot.armed else "Throttle disarmed")
    return FAILED if result is None else result


def _reposition(pilot: SimArduPlane, request: CommandRequest) -> int:
    """Circle a position, in GUIDED or with the flag that changes to it; param 3 is the radius."""
    above = None if request.frame is None else _ABOVE_HOME.get(request.frame)
    if above is None or pilot.home.place is None or not math.isfinite(request.latitude + request.longitude):
        return DENIED
    north, east, down = pilot.frame.ned_of(
        request.latitude, request.longitude, request.altitude + above * pilot.home.place[2]
    )
    if pilot.fence.is_outside((north, east, down)):
        return DENIED
    guided = pilot.modes["GUIDED"].custom
    if pilot.mode.name != "GUIDED" and not (whole(request.p2) & 1 and pilot.change_mode(guided)):
        return FAILED
    if not pilot.body.grounded:
        radius = request.p3 if math.isfinite(request.p3) and request.p3 > 0.0 else pilot.circle_radius
        pilot.manoeuvre = CircleManoeuvre(north, east, down, radius)
    return ACCEPTED


def _speed(pilot: SimArduPlane, request: CommandRequest) -> int:
    """Set an airspeed within its limits, in GUIDED and AUTO; a ground speed sets MIN_GROUNDSPEED."""
    params = pilot.params
    if pilot.mode.name not in {"GUIDED", "AUTO"}:
        return FAILED
    if whole(request.p1) == _AIRSPEED and request.p2 == _DEFAULT:
        pilot.airspeeds.requested = None
        return ACCEPTED
    if whole(request.p1) == _AIRSPEED and not params["AIRSPEED_MIN"] <= request.p2 <= params["AIRSPEED_MAX"]:
        return FAILED
    if whole(request.p1) == _AIRSPEED:
        pilot.airspeeds.requested = request.p2
    else:
        params["MIN_GROUNDSPEED"] = request.p2
    return ACCEPTED


def _land(pilot: SimArduPlane, _request: CommandRequest) -> int:
    """DO_LAND_START: continue the mission at its landing; fails without one."""
    items = pilot.missions.items
    found = [at for at, item in enumerate(items) if item.command == mav.MAV_CMD_DO_LAND_START]
    if not found or not pilot.missions.set_current(found[0]):
        pilot.say(WARNING, "Unable to start landing sequence")
        return FAILED
    return ACCEPTED if pilot.change_mode(pilot.modes["AUTO"].custom) else FAILED


def _return(pilot: SimArduPlane, _request: CommandRequest) -> int:
    return ACCEPTED if pilot.change_mode(pilot.modes["RTL"].custom) else FAILED


def _start_mission(pilot: SimArduPlane, _request: CommandRequest) -> int:
    return ACCEPTED if pilot.armed and pilot.change_mode(pilot.modes["AUTO"].custom) else FAILED


def _take_off_with_rotors(_pilot: SimArduPlane, _request: CommandRequest) -> int:
    """Fail: NAV_TAKEOFF is for QuadPlanes."""
    return FAILED


_NOT_KNOWN = frozenset({mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_DO_PAUSE_CONTINUE, mav.MAV_CMD_CONDITION_YAW})
COMMANDS: Mapping[int, CommandHandler] = {
    **{command: handler for command, handler in COPTERS.items() if command not in _NOT_KNOWN},
    mav.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_CHANGE_SPEED: _speed,
    mav.MAV_CMD_DO_LAND_START: _land,
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mav.MAV_CMD_NAV_TAKEOFF: _take_off_with_rotors,
    mav.MAV_CMD_MISSION_START: _start_mission,
}
