"""The MAVLink messages this adapter reads and writes, as typed values; nothing else is decoded.

Field names, units and scales are MAVLink's own (``common`` and ``ardupilotmega``): degrees times 1e7,
millimetres, cm/s, NED. ``state`` turns them into the project's units.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
from pymavlink.dialects.v20 import all as dialect


class MavlinkMessage(msgspec.Struct, frozen=True):
    """A MAVLink message; ``message_id`` is its number on the wire.

    ``packing`` is how its fields are packed (``struct``), where that is not what the dialect says.
    """

    message_id: ClassVar[int]
    packing: ClassVar[str] = ""


class Heartbeat(MavlinkMessage, frozen=True):
    """HEARTBEAT: who is there, in which mode, armed or not."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_HEARTBEAT
    type: int
    autopilot: int
    base_mode: int = 0
    custom_mode: int = 0
    system_status: int = 0
    mavlink_version: int = 3


class SysStatus(MavlinkMessage, frozen=True):
    """SYS_STATUS: sensor bits and the battery as the autopilot sums it up."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SYS_STATUS
    onboard_control_sensors_health: int
    voltage_battery: int  # mV, 65535 unknown
    current_battery: int  # cA, -1 unknown
    battery_remaining: int  # percent, -1 unknown
    onboard_control_sensors_present: int = 0


class SystemTime(MavlinkMessage, frozen=True):
    """SYSTEM_TIME: here only for the time since boot."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_SYSTEM_TIME
    time_boot_ms: int


class GpsRawInt(MavlinkMessage, frozen=True):
    """GPS_RAW_INT: the satellite receiver's own fix."""

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
    """GLOBAL_POSITION_INT: where the estimator thinks the vehicle is."""

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
    """MISSION_CURRENT: which item of the stored mission is active; total 65535 unknown."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_CURRENT
    seq: int
    total: int


class MissionItemReached(MavlinkMessage, frozen=True):
    """MISSION_ITEM_REACHED: an item of the stored mission was reached."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_MISSION_ITEM_REACHED
    seq: int


class RequestDataStream(MavlinkMessage, frozen=True):
    """REQUEST_DATA_STREAM: the old way to ask for rates, which only ArduPilot still obeys."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM
    target_system: int
    target_component: int
    req_stream_id: int
    req_message_rate: int
    start_stop: int = 1


class CommandInt(MavlinkMessage, frozen=True):
    """COMMAND_INT: a command with a place; x and y in degrees times 1e7."""

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
    """COMMAND_ACK: what the vehicle makes of a command; targets are 0 where it does not say."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_COMMAND_ACK
    command: int
    result: int
    progress: int = 0
    result_param2: int = 0
    target_system: int = 0
    target_component: int = 0


class SetPositionTargetLocalNed(MavlinkMessage, frozen=True):
    """SET_POSITION_TARGET_LOCAL_NED: the setpoint that is streamed; m/s and rad/s in NED."""

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
    """SET_POSITION_TARGET_GLOBAL_INT: a place to fly to; degrees times 1e7, m, yaw in radians from north."""

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
    """POSITION_TARGET_GLOBAL_INT: the place that the autopilot flies to; degrees times 1e7, m AMSL."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT
    lat_int: int
    lon_int: int
    alt: float


class BatteryStatus(MavlinkMessage, frozen=True):
    """BATTERY_STATUS: one battery; voltages in mV a cell, 65535 unknown.

    The last two are extensions, 0 where they are not told: seconds that are left, MAV_BATTERY_CHARGE_STATE.
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
    """ESTIMATOR_STATUS: PX4's estimator flags; the lower ten bits mean what ArduPilot's mean."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    time_usec: int
    flags: int


class HomePosition(MavlinkMessage, frozen=True):
    """HOME_POSITION: where the vehicle returns to; mm AMSL."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_HOME_POSITION
    latitude: int
    longitude: int
    altitude: int


class ExtendedSysState(MavlinkMessage, frozen=True):
    """EXTENDED_SYS_STATE: on the ground, taking off, in the air, landing; of a VTOL whether it hovers."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
    landed_state: int
    vtol_state: int = 0


class StatusTextMessage(MavlinkMessage, frozen=True):
    """STATUSTEXT: the autopilot's words, or a piece of them when ``id`` is not 0."""

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
Ask = CommandLong | CommandInt
