"""MAVLink messages of parameters and on-board logs, as typed values."""

from __future__ import annotations

from typing import ClassVar

from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink.messages import MavlinkMessage


class ParamRequestRead(MavlinkMessage, frozen=True):
    """PARAM_REQUEST_READ: by name, or by ``param_index`` if it is not negative."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ
    target_system: int
    target_component: int
    param_id: str = ""
    param_index: int = -1


class ParamRequestList(MavlinkMessage, frozen=True):
    """PARAM_REQUEST_LIST: request for all parameters."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST
    target_system: int
    target_component: int


class ParamValue(MavlinkMessage, frozen=True):
    """PARAM_VALUE: one parameter.

    ``param_value`` has the 32 bits on the wire: PX4's integers are not floats, and some of them would not
    survive a conversion.
    """

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_PARAM_VALUE
    packing: ClassVar[str] = "<IHH16sB"
    param_id: str
    param_value: int
    param_type: int
    param_count: int
    param_index: int


class ParamSet(MavlinkMessage, frozen=True):
    """PARAM_SET: ``param_value`` is 32 bits, as in PARAM_VALUE."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_PARAM_SET
    packing: ClassVar[str] = "<IBB16sB"
    target_system: int
    target_component: int
    param_id: str
    param_value: int
    param_type: int


class LogRequestList(MavlinkMessage, frozen=True):
    """LOG_REQUEST_LIST: the logs from ``start`` to ``end``."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_LOG_REQUEST_LIST
    target_system: int
    target_component: int
    start: int = 0
    end: int = 0xFFFF


class LogEntry(MavlinkMessage, frozen=True):
    """LOG_ENTRY: one log; ``time_utc`` in Unix seconds, 0 unknown; ``size`` in bytes."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_LOG_ENTRY
    id: int
    num_logs: int
    time_utc: int
    size: int


class LogRequestData(MavlinkMessage, frozen=True):
    """LOG_REQUEST_DATA: ``count`` bytes of a log from ``ofs`` on."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_LOG_REQUEST_DATA
    target_system: int
    target_component: int
    id: int
    ofs: int
    count: int


class LogData(MavlinkMessage, frozen=True):
    """LOG_DATA: ``count`` bytes of a log; fewer than 90 only at its end."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_LOG_DATA
    id: int
    ofs: int
    count: int
    data: tuple[int, ...]


class LogRequestEnd(MavlinkMessage, frozen=True):
    """LOG_REQUEST_END: end of the transfer; the autopilot resumes logging."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_LOG_REQUEST_END
    target_system: int
    target_component: int


INCOMING: tuple[type[MavlinkMessage], ...] = (LogData, LogEntry, ParamValue)
OUTGOING: tuple[type[MavlinkMessage], ...] = (
    LogRequestData,
    LogRequestEnd,
    LogRequestList,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
)
