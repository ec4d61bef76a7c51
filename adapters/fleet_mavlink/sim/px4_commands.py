"""PX4's handlers of its commands; all others are UNSUPPORTED."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.autopilot import CommandHandler, accept
from fleet_mavlink.sim.command_request import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    CommandRequest,
    ack,
    whole,
)
from fleet_mavlink.sim.common_commands import (
    FORCE,
    configure_gimbal,
    get_message_interval,
    message_interval,
    request_version,
    requested,
    turn_gimbal,
)
from fleet_mavlink.sim.local_frame import Geo
from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Idle, Manoeuvre
from fleet_mavlink.sim.message_output import CRITICAL, INFO
from fleet_mavlink.sim.px4_modes import MODES, MODES_BY_NUMBER
from fleet_mavlink.sim.px4_takeoff import Px4Takeoff
from fleet_mavlink.sim.streams import BUILDERS

if TYPE_CHECKING:
    from fleet_mavlink.sim.px4 import SimPx4

_COMMANDER = 0.008  # seconds after the MAVLink module at which the commander answers
_HOP = 0.6  # m climbed by a take-off to a height below the vehicle


def _arm(pilot: SimPx4, request: CommandRequest) -> int:
    """Arm (1) or disarm (0); 21196 disarms in the air."""
    if request.p1 not in {0.0, 1.0}:
        return UNSUPPORTED
    if request.p1 == 0.0:
        return _disarm(pilot, force=request.p2 == FORCE)
    if pilot.armed or pilot.terminated:
        return ACCEPTED  # a terminated flight acknowledges without effect
    refusals = pilot.arming.refusals(force=request.p2 == FORCE)
    for refusal in refusals:
        pilot.say(CRITICAL, f"Arming denied: {refusal}")
    if refusals:
        return TEMPORARILY_REJECTED
    pilot.arm()
    pilot.say(INFO, "Armed by external command")
    return ACCEPTED


def _disarm(pilot: SimPx4, *, force: bool) -> int:
    if pilot.armed and not pilot.land_detector.landed and not force:
        pilot.say(CRITICAL, "Disarming denied: not landed")
        return TEMPORARILY_REJECTED
    if pilot.armed:
        pilot.say(INFO, "Disarmed by external command")
        pilot.disarm()
    return ACCEPTED


def _take_off(pilot: SimPx4, request: CommandRequest) -> int:
    """Take off to AMSL, whatever the frame; NaN keeps a value, 0/0 is a position in the Gulf of Guinea."""
    if pilot.terminated:
        return TEMPORARILY_REJECTED
    pilot.takeoff.request(_takeoff_manoeuvre(pilot, request))
    return ACCEPTED


def _takeoff_manoeuvre(pilot: SimPx4, request: CommandRequest) -> Manoeuvre:
    if request.latitude == 0.0 and request.longitude == 0.0:
        return Idle()
    here = pilot.geo()[2]
    altitude = request.altitude if math.isfinite(request.altitude) else here + pilot.params["MIS_TAKEOFF_ALT"]
    if altitude <= here:
        pilot.say(CRITICAL, "Already higher than takeoff altitude")
        altitude = here + (_HOP if pilot.body.grounded else 0.0)
    return Px4Takeoff(pilot, altitude)


def _set_mode(pilot: SimPx4, request: CommandRequest) -> None:
    """Acknowledge twice: the MAVLink module always accepts, then the commander answers."""
    pilot.acknowledge(request, ACCEPTED)
    mode = MODES_BY_NUMBER.get((whole(request.p3) << 24 | whole(request.p2) << 16) & 0xFFFFFFFF)
    custom = whole(request.p1) & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    result = pilot.change_mode(mode) if custom and mode else ACCEPTED
    if "no_ack" not in pilot.faults:
        pilot.later(pilot.ack_delay + _COMMANDER, ack(request, result))


def _return(pilot: SimPx4, _command: CommandRequest) -> int:
    result = pilot.change_mode(MODES["RTL"])
    if result == ACCEPTED:
        pilot.say(INFO, "Returning to launch")
    return result


def _land(pilot: SimPx4, _command: CommandRequest) -> int:
    """Land; accepted also without a position."""
    result = pilot.change_mode(MODES["LAND"])
    if result == ACCEPTED:
        pilot.say(INFO, "Landing at current position")
    return result


def _orbit(pilot: SimPx4, _command: CommandRequest) -> int:
    """Show the mode; the circle is not flown."""
    return pilot.change_mode(MODES["ORBIT"])


def _unanswered(_pilot: SimPx4, _command: CommandRequest) -> None:
    """Do nothing and send nothing: no module on the simulated board handles it."""


def _start_mission(pilot: SimPx4, _command: CommandRequest) -> int:
    """Start the mission; arms if necessary."""
    if not pilot.missions.loaded:
        return DENIED
    pilot.enter(MODES["MISSION"])
    if not pilot.armed:
        refusals = pilot.arming.refusals(force=False)
        if refusals:
            pilot.say(CRITICAL, f"Arming denied: {refusals[0]}")
            return TEMPORARILY_REJECTED
        pilot.arm()
    return ACCEPTED


def _reposition(pilot: SimPx4, request: CommandRequest) -> int:
    """Fly to a position, AMSL whatever the frame; NaN keeps a value; heading in radians."""
    if not whole(request.p2) & 1:
        return UNSUPPORTED
    place = (request.latitude, request.longitude, request.altitude)
    return _go(pilot, place, heading=request.p4, speed=request.p1)


def _altitude(pilot: SimPx4, request: CommandRequest) -> int:
    """DO_CHANGE_ALTITUDE: AMSL."""
    return _go(pilot, (math.nan, math.nan, request.p1), heading=math.nan, speed=-1.0)


def _go(pilot: SimPx4, place: Geo, *, heading: float, speed: float) -> int:
    """Change to LOITER at a position; NaN keeps a value."""
    landed = pilot.land_detector.landed  # until a take-off is detected, which is before it leaves the ground
    result = pilot.change_mode(MODES["LOITER"])
    if result != ACCEPTED or landed or not pilot.armed:
        return result
    wanted = [new if math.isfinite(new) else now for new, now in zip(place, pilot.geo(), strict=True)]
    north, east, down = pilot.frame.ned_of(*wanted)
    turned = heading if math.isfinite(heading) else None
    pilot.manoeuvre = GoToManoeuvre(north, east, down, heading=turned, speed=speed if speed > 0.0 else None)
    return ACCEPTED


def _speed(pilot: SimPx4, request: CommandRequest) -> int:
    """Set the speed, m/s; -1 keeps it."""
    if request.p2 > 0.0:
        pilot.speeds.requested = request.p2
    return ACCEPTED


def _home(pilot: SimPx4, request: CommandRequest) -> int:
    """Set home here (param 1 = 1), or at a position."""
    place = (request.latitude, request.longitude, request.altitude)
    if request.p1 == 1.0:
        pilot.home.set_here()
    elif all(map(math.isfinite, place)):
        pilot.home.place = place
    else:
        return DENIED
    return ACCEPTED


def _terminate(pilot: SimPx4, request: CommandRequest) -> int:
    """Stop the motors while the heartbeat stays armed; only a reboot ends it."""
    if not request.p1 > 1.5 and request.p1 != 1.0:
        return DENIED
    pilot.terminated = True
    pilot.enter(MODES["TERMINATION"])
    return ACCEPTED


def _reboot(pilot: SimPx4, request: CommandRequest) -> int:
    if pilot.armed or request.p1 not in {1.0, 3.0}:
        return DENIED
    pilot.reboot_requested = True
    return ACCEPTED


def _interval(pilot: SimPx4, request: CommandRequest) -> int:
    """Set an interval; unknown messages fail."""
    return message_interval(pilot, request) if whole(request.p1) in BUILDERS else FAILED


def _request(pilot: SimPx4, request: CommandRequest) -> int:
    """Send a message; denied if it is unknown, or has no data yet."""
    message = requested(pilot, whole(request.p1))
    if message is None:
        return DENIED
    pilot.out.append(message)
    return ACCEPTED


def _check(pilot: SimPx4, _command: CommandRequest) -> int:
    """RUN_PREARM_CHECKS: send the reasons against arming at once."""
    if pilot.armed:
        return TEMPORARILY_REJECTED
    for refusal in pilot.arming.refusals(force=False):
        pilot.say(CRITICAL, f"Preflight Fail: {refusal}")
    return ACCEPTED


def _calibrate(pilot: SimPx4, request: CommandRequest) -> int:
    """PREFLIGHT_CALIBRATION: parameter 2 calibrates the compass; all zero stops it; others finish at once."""
    if pilot.armed:
        return TEMPORARILY_REJECTED
    if request.p2 == 1.0:
        pilot.equipment.compass.start(pilot.time, pilot)
    elif not any((request.p1, request.p2, request.p3, request.p4)):
        pilot.equipment.compass.cancel(pilot)
    return ACCEPTED


COMMANDS: Mapping[int, CommandHandler] = {
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mav.MAV_CMD_NAV_LAND: _land,
    mav.MAV_CMD_NAV_TAKEOFF: _take_off,
    mav.MAV_CMD_DO_ORBIT: _orbit,
    mav.MAV_CMD_DO_SET_MODE: _set_mode,
    mav.MAV_CMD_DO_CHANGE_SPEED: _speed,
    mav.MAV_CMD_DO_SET_HOME: _home,
    mav.MAV_CMD_DO_FLIGHTTERMINATION: _terminate,
    mav.MAV_CMD_DO_CHANGE_ALTITUDE: _altitude,
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_SET_ROI_NONE: accept,
    mav.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    mav.MAV_CMD_MISSION_START: _start_mission,
    mav.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mav.MAV_CMD_RUN_PREARM_CHECKS: _check,
    mav.MAV_CMD_INJECT_FAILURE: _unanswered,
    mav.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: configure_gimbal,
    mav.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: turn_gimbal,
    mav.MAV_CMD_GET_MESSAGE_INTERVAL: get_message_interval,
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: _interval,
    mav.MAV_CMD_REQUEST_MESSAGE: _request,
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: request_version,
}
