"""ArduCopter's handlers of its commands; all others are UNSUPPORTED."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.ardupilot_modes import MODES
from fleet_mavlink.sim.autopilot import CommandHandler, accept
from fleet_mavlink.sim.command_request import (
    ACCEPTED,
    DENIED,
    FAILED,
    IN_PROGRESS,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    CommandRequest,
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
from fleet_mavlink.sim.manoeuvres import GoToManoeuvre, Idle, Takeoff, Turn, hold
from fleet_mavlink.sim.message_output import CRITICAL, INFO
from fleet_mavlink.sim.streams import BUILDERS

if TYPE_CHECKING:
    from fleet_mavlink.sim.ardupilot import ArduPilot

_SKIP_CHECKS = 2989
_FASTEST = 1 / 400  # s, shortest interval between messages
_MOTOR_STOP = 31  # auxiliary function


def _result(done: bool) -> int:  # noqa: FBT001 - turns an outcome into MAV_RESULT
    return ACCEPTED if done else FAILED


def _arm(pilot: ArduPilot, request: CommandRequest) -> int:
    """Arm (1) or disarm (0); 21196 disarms in the air and skips the checks of arming."""
    if request.p1 not in {0.0, 1.0}:
        return UNSUPPORTED
    if request.p1 == 0.0:
        return _disarm(pilot, force=request.p2 == FORCE)
    if pilot.armed:
        return ACCEPTED
    refusals = pilot.arming.refusals_to_arm(force=request.p2 in {FORCE, _SKIP_CHECKS})
    for refusal in refusals:
        pilot.say(CRITICAL, f"Arm: {refusal}")
    if refusals:
        return FAILED
    pilot.arm()
    pilot.say(INFO, "Arming motors")
    pilot.enter(pilot.mode)
    return ACCEPTED


def _disarm(pilot: ArduPilot, *, force: bool) -> int:
    if pilot.armed and pilot.flying and not force:
        return FAILED
    if pilot.armed:
        pilot.say(INFO, "Disarming motors")
    pilot.disarm()
    return ACCEPTED


def _take_off(pilot: ArduPilot, request: CommandRequest) -> int:
    """Metres above home; COMMAND_INT only in GLOBAL_RELATIVE_ALT."""
    if request.frame is not None and request.frame != mav.MAV_FRAME_GLOBAL_RELATIVE_ALT:
        return DENIED
    able = pilot.armed and pilot.mode.name == "GUIDED" and not pilot.flying
    if not able or not request.altitude > 0.0:
        return FAILED
    pilot.manoeuvre = Takeoff(pilot, pilot.home.ned()[2] - request.altitude)
    return ACCEPTED


def _set_mode(pilot: ArduPilot, request: CommandRequest) -> int:
    if not whole(request.p1) & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return FAILED
    return _result(pilot.change_mode(whole(request.p2)))


def _return(pilot: ArduPilot, _command: CommandRequest) -> int:
    return _result(pilot.change_mode(MODES["RTL"].custom))


def _land(pilot: ArduPilot, _command: CommandRequest) -> int:
    return _result(pilot.change_mode(MODES["LAND"].custom))


def _start_mission(pilot: ArduPilot, request: CommandRequest) -> int:
    """Start only when armed, and only the whole mission."""
    if request.p1 or request.p2 or not pilot.missions.loaded:
        return DENIED
    return _result(pilot.armed and pilot.change_mode(MODES["AUTO"].custom))


def _set_current(pilot: ArduPilot, request: CommandRequest) -> int:
    """Continue with an item, now or when the mission is flown; 0 restarts it."""
    return _result(pilot.missions.set_current(whole(request.p1)))


def _turn(pilot: ArduPilot, request: CommandRequest) -> int:
    """Turn to degrees 0 to 360 at degrees per second, absolute or relative (param 4)."""
    if pilot.mode.name != "GUIDED" or not pilot.flying or not 0.0 <= request.p1 <= 360.0:
        return FAILED
    heading = math.radians(request.p1)
    direction = whole(request.p3)
    if request.p4:
        heading = pilot.body.heading + heading * (direction or 1)
    rate = math.radians(request.p2) if request.p2 > 0.0 else pilot.agility.turn
    pilot.manoeuvre = Turn(pilot, heading, rate, direction)
    return ACCEPTED


def _reposition(pilot: ArduPilot, request: CommandRequest) -> int:
    """Fly to a position; COMMAND_INT only; frames 0 and 5 are AMSL, 3 and 6 above home."""
    if request.frame is None:
        return UNSUPPORTED
    above_home = {0: 0.0, 5: 0.0, 3: 1.0, 6: 1.0}.get(request.frame)
    if above_home is None or pilot.home.place is None:
        return DENIED
    if pilot.mode.name != "GUIDED" and not (
        whole(request.p2) & 1 and pilot.change_mode(MODES["GUIDED"].custom)
    ):
        return DENIED
    place = pilot.frame.ned_of(
        request.latitude, request.longitude, request.altitude + above_home * pilot.home.place[2]
    )
    if not pilot.flying or not all(map(math.isfinite, place)):
        return DENIED
    if pilot.fence.is_outside(place):
        return FAILED
    pilot.manoeuvre = GoToManoeuvre(*place, speed=request.p1 if request.p1 > 0.0 else None)
    return ACCEPTED


def _pause(pilot: ArduPilot, request: CommandRequest) -> int:
    """Hold (0) or continue (1) in GUIDED and AUTO."""
    if pilot.mode.name not in {"GUIDED", "AUTO"}:
        return DENIED
    if request.p1 == 0.0 and pilot.paused is None:
        pilot.paused, pilot.manoeuvre = pilot.manoeuvre, hold(pilot)
    elif request.p1 == 1.0 and pilot.paused is not None:
        pilot.manoeuvre, pilot.paused = pilot.paused, None
    return ACCEPTED


def _speed(pilot: ArduPilot, request: CommandRequest) -> int:
    """Set the speed for later moves."""
    if not request.p2 > 0.0:
        return FAILED
    pilot.speeds.requested = request.p2
    return ACCEPTED


def _home(pilot: ArduPilot, request: CommandRequest) -> int:
    """Set home here (param 1 = 1), or at a position."""
    if not pilot.home.known:
        return FAILED
    if request.p1 == 1.0:
        pilot.home.set_here()
        return ACCEPTED
    place = (request.latitude, request.longitude, request.altitude)
    if not all(map(math.isfinite, place)) or place[:2] == (0.0, 0.0):
        return FAILED
    pilot.home.place = place
    return ACCEPTED


def _terminate(pilot: ArduPilot, request: CommandRequest) -> int:
    """Disarm by force."""
    return _disarm(pilot, force=True) if request.p1 >= 1.0 else FAILED


def _auxiliary(pilot: ArduPilot, request: CommandRequest) -> int:
    """Stop the motors but stay armed: releasing it starts them again."""
    if request.p1 != _MOTOR_STOP:
        return FAILED
    if request.p2 == 2.0 and pilot.motors_stopped is None:
        pilot.motors_stopped, pilot.manoeuvre = pilot.manoeuvre, Idle()
    elif request.p2 == 0.0 and pilot.motors_stopped is not None:
        pilot.manoeuvre, pilot.motors_stopped = pilot.motors_stopped, None
    return ACCEPTED


def _reboot(pilot: ArduPilot, request: CommandRequest) -> int:
    if pilot.armed or request.p1 not in {1.0, 3.0}:
        return FAILED
    pilot.reboot_requested = True
    return ACCEPTED


def _calibrate(pilot: ArduPilot, request: CommandRequest) -> int:
    """Send IN_PROGRESS and immediately the result."""
    if pilot.armed:
        return FAILED
    pilot.acknowledge(request, IN_PROGRESS)
    return ACCEPTED


def _interval(pilot: ArduPilot, request: CommandRequest) -> int:
    """Set an interval; unknown messages and rates of 400 Hz and more are denied."""
    if whole(request.p1) not in BUILDERS or 0.0 < request.p2 <= _FASTEST * 1e6:
        if whole(request.p1) in BUILDERS:
            pilot.say(CRITICAL, "Requested rate for message is too fast")
        return DENIED
    return message_interval(pilot, request)


def _request(pilot: ArduPilot, request: CommandRequest) -> int:
    """Send a message; accepted also if it cannot be built yet, and then not sent."""
    message = requested(pilot, whole(request.p1))
    if message is not None:
        pilot.out.append(message)
    return ACCEPTED if message is not None or whole(request.p1) in BUILDERS else FAILED


def _check(pilot: ArduPilot, _command: CommandRequest) -> int:
    """RUN_PREARM_CHECKS: send the reasons against arming at once."""
    if pilot.armed:
        return TEMPORARILY_REJECTED
    for refusal in pilot.arming.refusals(force=False):
        pilot.say(CRITICAL, f"PreArm: {refusal}")
    return ACCEPTED


def _start_compass(pilot: ArduPilot, _command: CommandRequest) -> int:
    if pilot.armed:
        pilot.say(CRITICAL, "Disarm to allow calibration")
        return FAILED
    pilot.equipment.compass.start(pilot.time, pilot)
    return ACCEPTED


def _cancel_compass(pilot: ArduPilot, _command: CommandRequest) -> int:
    pilot.equipment.compass.cancel(pilot)
    return ACCEPTED


COMMANDS: Mapping[int, CommandHandler] = {
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mav.MAV_CMD_NAV_LAND: _land,
    mav.MAV_CMD_NAV_TAKEOFF: _take_off,
    mav.MAV_CMD_CONDITION_YAW: _turn,
    mav.MAV_CMD_DO_SET_MODE: _set_mode,
    mav.MAV_CMD_DO_CHANGE_SPEED: _speed,
    mav.MAV_CMD_DO_SET_HOME: _home,
    mav.MAV_CMD_DO_FLIGHTTERMINATION: _terminate,
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    mav.MAV_CMD_DO_SET_ROI_NONE: accept,
    mav.MAV_CMD_DO_AUX_FUNCTION: _auxiliary,
    mav.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    mav.MAV_CMD_MISSION_START: _start_mission,
    mav.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mav.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mav.MAV_CMD_RUN_PREARM_CHECKS: _check,
    mav.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: configure_gimbal,
    mav.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: turn_gimbal,
    mav.MAV_CMD_DO_START_MAG_CAL: _start_compass,
    mav.MAV_CMD_DO_CANCEL_MAG_CAL: _cancel_compass,
    mav.MAV_CMD_GET_MESSAGE_INTERVAL: get_message_interval,
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: _interval,
    mav.MAV_CMD_REQUEST_MESSAGE: _request,
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: request_version,
}
