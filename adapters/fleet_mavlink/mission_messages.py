"""MAVLink messages for the transfer of plans (missions, fences), as typed values."""

from __future__ import annotations

from typing import ClassVar

from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink.messages import MavlinkMessage


class MissionRequest(MavlinkMessage, frozen=True):
    """MISSION_REQUEST: request for one item, in the deprecated form that ArduPilot still uses."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_REQUEST
    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


class MissionRequestList(MavlinkMessage, frozen=True):
    """MISSION_REQUEST_LIST: request for the number of items."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST
    target_system: int
    target_component: int
    mission_type: int = 0


class MissionCount(MavlinkMessage, frozen=True):
    """MISSION_COUNT: number of items that follow, or are stored."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_COUNT
    target_system: int
    target_component: int
    count: int
    mission_type: int = 0


class MissionClearAll(MavlinkMessage, frozen=True):
    """MISSION_CLEAR_ALL: delete a plan."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL
    target_system: int
    target_component: int
    mission_type: int = 0


class MissionAck(MavlinkMessage, frozen=True):
    """MISSION_ACK: result of a transfer (MAV_MISSION_RESULT); targets as in COMMAND_ACK."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_ACK
    target_system: int
    target_component: int
    type: int
    mission_type: int = 0


class MissionRequestInt(MavlinkMessage, frozen=True):
    """MISSION_REQUEST_INT: request for one item, with its position in degrees times 1e7."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT
    target_system: int
    target_component: int
    seq: int
    mission_type: int = 0


class MissionItemInt(MavlinkMessage, frozen=True):
    """MISSION_ITEM_INT: one item; x and y in degrees times 1e7, z in metres."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT
    target_system: int
    target_component: int
    seq: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 1
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    mission_type: int = 0


INCOMING: tuple[type[MavlinkMessage], ...] = (
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
)
OUTGOING: tuple[type[MavlinkMessage], ...] = (
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
)
