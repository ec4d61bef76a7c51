"""A QuadPlane's handlers of its commands, beside those of ArduPlane."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import CommandHandler
from fleet_mavlink.sim.command_request import ACCEPTED, DENIED, FAILED, CommandRequest, whole
from fleet_mavlink.sim.manoeuvres import Takeoff
from fleet_mavlink.sim.message_output import INFO
from fleet_mavlink.sim.plane_commands import COMMANDS as PLANES

if TYPE_CHECKING:
    from fleet_mavlink.sim.quadplane import SimQuadPlane

_OFFSET = 7  # MAV_FRAME_LOCAL_OFFSET_NED
_ABOVE_HOME = {0: 0.0, 5: 0.0, 3: 1.0, 6: 1.0}  # frames


def _take_off(pilot: SimQuadPlane, request: CommandRequest) -> int:
    """Climb by the given height above its present position, in GUIDED; only as an offset."""
    if request.frame is not None and request.frame != _OFFSET:
        return DENIED
    height = -request.altitude if request.frame is not None else request.altitude
    if pilot.mode.name != "GUIDED":
        pilot.say(INFO, "User Takeoff only in GUIDED mode")
        return FAILED
    if not pilot.armed:
        pilot.say(INFO, "Must be armed for takeoff")
        return FAILED
    if pilot.flying:
        pilot.say(INFO, "Already flying - no takeoff")
        return FAILED
    pilot.hover()
    pilot.manoeuvre = Takeoff(pilot, pilot.body.down - height)
    return ACCEPTED


def _reposition(pilot: SimQuadPlane, request: CommandRequest) -> int:
    """Go to a position: hover there with Q_GUIDED_MODE 1, else as a plane."""
    if not pilot.hovers_in_guided:
        result = PLANES[mav.MAV_CMD_DO_REPOSITION](pilot, request)
        if result == ACCEPTED and pilot.flying and pilot.body.hovers:
            pilot.go_forward(pilot.manoeuvre)
        return FAILED if result is None else result
    above = None if request.frame is None else _ABOVE_HOME.get(request.frame)
    if above is None or pilot.home.place is None or not math.isfinite(request.latitude + request.longitude):
        return DENIED
    guided = pilot.modes["GUIDED"].custom
    if pilot.mode.name != "GUIDED" and not (whole(request.p2) & 1 and pilot.change_mode(guided)):
        return FAILED
    if pilot.flying:
        altitude = request.altitude + above * pilot.home.place[2]
        pilot.go_to(*pilot.frame.ned_of(request.latitude, request.longitude, altitude))
    return ACCEPTED


def _transition(pilot: SimQuadPlane, _request: CommandRequest) -> int:
    """Accept it in AUTO only."""
    return ACCEPTED if pilot.mode.name == "AUTO" else FAILED


COMMANDS: Mapping[int, CommandHandler] = {
    **PLANES,
    mav.MAV_CMD_NAV_TAKEOFF: _take_off,
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_VTOL_TRANSITION: _transition,
}
