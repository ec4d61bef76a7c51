"""ArduRover's handlers of its commands; all others, also a take-off, are UNSUPPORTED."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot_commands import COMMANDS as COPTERS
from fleet_mavlink.sim.autopilot import CommandHandler
from fleet_mavlink.sim.command_request import ACCEPTED, DENIED, FAILED, CommandRequest, whole
from fleet_mavlink.sim.common_commands import FORCE
from fleet_mavlink.sim.message_output import CRITICAL, INFO
from fleet_mavlink.sim.rover_moves import DriveToPosition

if TYPE_CHECKING:
    from fleet_mavlink.sim.rover import SimArduRover

_UNSUPPORTED = frozenset(
    {
        mav.MAV_CMD_NAV_TAKEOFF,
        mav.MAV_CMD_NAV_LAND,
        mav.MAV_CMD_DO_PAUSE_CONTINUE,
        mav.MAV_CMD_CONDITION_YAW,
    }
)


def _arm(pilot: SimArduRover, request: CommandRequest) -> int:
    """Arm (1) or disarm (0), even while it drives."""
    if request.p1 == 0.0:
        if pilot.armed:
            pilot.say(INFO, "Throttle disarmed")
        pilot.disarm()
        return ACCEPTED
    if pilot.armed:
        return ACCEPTED
    refusals = pilot.arming.refusals_to_arm(force=request.p2 == FORCE)
    for refusal in refusals:
        pilot.say(CRITICAL, f"Arm: {refusal}")
    if refusals:
        return FAILED
    pilot.arm()
    pilot.say(INFO, "Throttle armed")
    pilot.enter(pilot.mode)
    return ACCEPTED


def _set_mode(pilot: SimArduRover, request: CommandRequest) -> int:
    """Change the mode; denied without the flag for a custom mode."""
    if not whole(request.p1) & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return DENIED
    return ACCEPTED if pilot.change_mode(whole(request.p2)) else FAILED


def _reposition(pilot: SimArduRover, request: CommandRequest) -> int:
    """Drive to a position: COMMAND_INT, in GUIDED or with the flag that changes to it."""
    if request.frame is None or not math.isfinite(request.latitude + request.longitude):
        return DENIED
    guided = pilot.modes["GUIDED"].custom
    if pilot.mode.name != "GUIDED" and not (whole(request.p2) & 1 and pilot.change_mode(guided)):
        return DENIED
    north, east, _ = pilot.frame.ned_of(request.latitude, request.longitude, 0.0)
    pilot.manoeuvre = DriveToPosition(north, east)
    return ACCEPTED


def _speed(pilot: SimArduRover, request: CommandRequest) -> int:
    """Set the speed; fails without effect for a speed of 0, and without a target position."""
    if not request.p2 > 0.0 or not isinstance(pilot.manoeuvre, DriveToPosition):
        return FAILED
    pilot.speeds.requested = request.p2
    return ACCEPTED


def _reverse(pilot: SimArduRover, request: CommandRequest) -> int:
    """Drive to positions in reverse (1) or forward (0), until the mode changes."""
    pilot.reversed = request.p1 == 1.0
    return ACCEPTED


def _return(pilot: SimArduRover, _request: CommandRequest) -> int:
    return ACCEPTED if pilot.change_mode(pilot.modes["RTL"].custom) else FAILED


def _start_mission(pilot: SimArduRover, _request: CommandRequest) -> int:
    return ACCEPTED if pilot.armed and pilot.change_mode(pilot.modes["AUTO"].custom) else FAILED


COMMANDS: Mapping[int, CommandHandler] = {
    **{command: handler for command, handler in COPTERS.items() if command not in _UNSUPPORTED},
    mav.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mav.MAV_CMD_DO_SET_MODE: _set_mode,
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_CHANGE_SPEED: _speed,
    mav.MAV_CMD_DO_SET_REVERSE: _reverse,
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mav.MAV_CMD_MISSION_START: _start_mission,
}
