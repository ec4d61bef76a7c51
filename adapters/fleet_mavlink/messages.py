"""MAVLink messages read and written by this adapter, as typed values; no others are decoded.

Field names, units and scales are those of MAVLink (``common`` and ``ardupilotmega``): degrees times 1e7,
millimetres, cm/s, NED. ``state`` converts them to the project's units.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
from pymavlink.dialects.v20 import all as dialect


class MavlinkMessage(msgspec.Struct, frozen=True):
    """A MAVLink message; ``message_id`` is its number on the wire.

    ``packing``: format of its fields (``struct``), if it differs from the dialect.
    """

    message_id: ClassVar[int]
    packing: ClassVar[str] = ""


class Heartbeat(MavlinkMessage, frozen=True):
    """HEARTBEAT: sender, mode, armed or not."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_HEARTBEAT
    type: int
    autopilot: int
    base_mode: int = 0
    custom_mode: int = 0
    system_status: int = 0
    mavlink_version: int = 3


class SysStatus(MavlinkMessage, frozen=True):
    """SYS_STATUS: sensor bits, and the autopilot's summary of the battery."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SYS_STATUS
    onboard_control_sensors_health: int
    voltage_battery: int  # mV, 65535 unknown
    current_battery: int  # cA, -1 unknown
    battery_remaining: int  # percent, -1 unknown
    onboard_control_sensors_present: int = 0


class SystemTime(MavlinkMessage, frozen=True):
    """SYSTEM_TIME: used for the time since boot only."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SYSTEM_TIME
    time_boot_ms: int


class GpsRawInt(MavlinkMessage, frozen=True):
    """GPS_RAW_INT: fix of the satellite receiver."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_GPS_RAW_INT
    fix_type: int
    lat: int
    lon: int
    alt: int  # mm AMSL
    satellites_visible: int  # 255 unknown
    h_acc: int  # mm, 0 unknown
    v_acc: int  # mm, 0 unknown


class Attitude(MavlinkMessage, frozen=True):
    """ATTITUDE: FRD in NED, radians and rad/s."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_ATTITUDE
    time_boot_ms: int
    roll: float
    pitch: float
    yaw: float


class GlobalPositionInt(MavlinkMessage, frozen=True):
    """GLOBAL_POSITION_INT: position estimate."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    time_boot_ms: int
    lat: int
    lon: int
    alt: int  # mm AMSL
    relative_alt: int  # mm above home
    vx: int  # cm/s north
    vy: int  # cm/s east
    vz: int  # cm/s down
    hdg: int  # 0.01 degrees, 65535 unknown


class MissionCurrent(MavlinkMessage, frozen=True):
    """MISSION_CURRENT: active item of the stored mission; total 65535 unknown."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_CURRENT
    seq: int
    total: int


class MissionItemReached(MavlinkMessage, frozen=True):
    """MISSION_ITEM_REACHED: an item of the stored mission was reached."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
    seq: int


class RequestDataStream(MavlinkMessage, frozen=True):
    """REQUEST_DATA_STREAM: deprecated request for rates, which ArduPilot still accepts."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM
    target_system: int
    target_component: int
    req_stream_id: int
    req_message_rate: int
    start_stop: int = 1


class CommandInt(MavlinkMessage, frozen=True):
    """COMMAND_INT: a command with a position; x and y in degrees times 1e7."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_COMMAND_INT
    command: int
    target_system: int = 0
    target_component: int = 1
    frame: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0


class CommandLong(MavlinkMessage, frozen=True):
    """COMMAND_LONG: a command with seven numbers."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_COMMAND_LONG
    command: int
    target_system: int = 0
    target_component: int = 1
    confirmation: int = 0
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


class CommandAck(MavlinkMessage, frozen=True):
    """COMMAND_ACK: the vehicle's result for a command; targets are 0 if it does not fill them in."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_COMMAND_ACK
    command: int
    result: int
    progress: int = 0
    result_param2: int = 0
    target_system: int = 0
    target_component: int = 0


class SetPositionTargetLocalNed(MavlinkMessage, frozen=True):
    """SET_POSITION_TARGET_LOCAL_NED: velocity setpoint; m/s and rad/s in NED."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    vx: float
    vy: float
    vz: float
    yaw_rate: float
    time_boot_ms: int = 0


class SetPositionTargetGlobalInt(MavlinkMessage, frozen=True):
    """SET_POSITION_TARGET_GLOBAL_INT: position target; degrees times 1e7, m, yaw in radians from north."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    lat_int: int
    lon_int: int
    alt: float
    yaw: float


class PositionTargetGlobalInt(MavlinkMessage, frozen=True):
    """POSITION_TARGET_GLOBAL_INT: the autopilot's present target; degrees times 1e7, m AMSL."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT
    lat_int: int
    lon_int: int
    alt: float


class BatteryStatus(MavlinkMessage, frozen=True):
    """BATTERY_STATUS: one battery; voltages in mV per cell, 65535 unknown.

    The last two are extensions, 0 if not reported: remaining seconds, MAV_BATTERY_CHARGE_STATE.
    """

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_BATTERY_STATUS
    id: int
    voltages: tuple[int, ...]
    current_battery: int  # cA, -1 unknown
    battery_remaining: int  # percent, -1 unknown
    time_remaining: int = 0
    charge_state: int = 0


class EkfStatusReport(MavlinkMessage, frozen=True):
    """EKF_STATUS_REPORT: ArduPilot's estimator flags."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT
    flags: int


class EstimatorStatus(MavlinkMessage, frozen=True):
    """ESTIMATOR_STATUS: PX4's estimator flags; the lower ten bits have the same meaning as ArduPilot's."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    time_usec: int
    flags: int


class HomePosition(MavlinkMessage, frozen=True):
    """HOME_POSITION: position to which the vehicle returns; mm AMSL."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_HOME_POSITION
    latitude: int
    longitude: int
    altitude: int


class ExtendedSysState(MavlinkMessage, frozen=True):
    """EXTENDED_SYS_STATE: on the ground, taking off, in the air, landing; state of a VTOL."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
    landed_state: int
    vtol_state: int = 0


class StatusTextMessage(MavlinkMessage, frozen=True):
    """STATUSTEXT: a text of the autopilot, or a chunk of one if ``id`` is not 0."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_STATUSTEXT
    severity: int
    text: str
    id: int = 0
    chunk_seq: int = 0


INCOMING: tuple[type[MavlinkMessage], ...] = (
    Attitude,
    BatteryStatus,
    CommandAck,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    MissionCurrent,
    MissionItemReached,
    PositionTargetGlobalInt,
    StatusTextMessage,
    SysStatus,
    SystemTime,
)
OUTGOING: tuple[type[MavlinkMessage], ...] = (
    CommandInt,
    CommandLong,
    Heartbeat,
    RequestDataStream,
    SetPositionTargetGlobalInt,
    SetPositionTargetLocalNed,
)
MavlinkCommand = CommandLong | CommandInt
