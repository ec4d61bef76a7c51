"""Commands that both autopilots execute alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.command_request import ACCEPTED, CommandRequest, whole
from fleet_mavlink.sim.streams import BUILDERS, autopilot_version

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot

FORCE = 21196.0  # param 2 of arm and disarm


def message_interval(pilot: Autopilot, request: CommandRequest) -> int:
    """SET_MESSAGE_INTERVAL: microseconds; 0 is the default rate, -1 off."""
    if request.p2 == 0.0:
        pilot.streams.reset(whole(request.p1), pilot.time)
    else:
        pilot.streams.set(whole(request.p1), request.p2 / 1e6, pilot.time)
    return ACCEPTED


def get_message_interval(pilot: Autopilot, request: CommandRequest) -> int:
    """GET_MESSAGE_INTERVAL, answered by MESSAGE_INTERVAL: -1 for a message that is not sent."""
    every = pilot.streams.every(whole(request.p1))
    pilot.out.append(
        mav.MAVLink_message_interval_message(whole(request.p1), int(every * 1e6) if every else -1)
    )
    return ACCEPTED


def configure_gimbal(pilot: Autopilot, request: CommandRequest) -> int | None:
    """DO_GIMBAL_MANAGER_CONFIGURE: take control of the gimbal."""
    gimbal = pilot.equipment.gimbal
    return pilot.without_gimbal if gimbal is None else gimbal.configure(request)


def turn_gimbal(pilot: Autopilot, request: CommandRequest) -> int | None:
    """DO_GIMBAL_MANAGER_PITCHYAW."""
    gimbal = pilot.equipment.gimbal
    return pilot.without_gimbal if gimbal is None else gimbal.turn(request)


def requested(pilot: Autopilot, message_id: int) -> object:
    """Return the message requested by REQUEST_MESSAGE, None if it is unknown or has no data yet."""
    gimbal = pilot.equipment.gimbal
    if message_id == mav.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION:
        return None if gimbal is None else gimbal.information(pilot.uptime.ms)
    build = BUILDERS.get(message_id)
    return build(pilot) if build is not None else None


def request_version(pilot: Autopilot, _request: CommandRequest) -> int:
    """REQUEST_AUTOPILOT_CAPABILITIES, the deprecated request for AUTOPILOT_VERSION."""
    pilot.out.append(autopilot_version(pilot))
    return ACCEPTED
