"""EVENT, which pymavlink's dialects lack, and the file transfer for event metadata."""

from __future__ import annotations

import struct
from typing import ClassVar

from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink.messages import MavlinkMessage


class EventWire:
    """EVENT in the form of pymavlink's message classes (``common``: message 410, wire order by size)."""

    msgname = "EVENT"
    crc_extra = 160
    unpacker = struct.Struct("<IIHBBB40B")
    fieldnames: ClassVar[list[str]] = [
        "destination_component",
        "destination_system",
        "id",
        "event_time_boot_ms",
        "sequence",
        "log_levels",
        "arguments",
    ]
    fieldtypes: ClassVar[list[str]] = [
        "uint8_t",
        "uint8_t",
        "uint32_t",
        "uint32_t",
        "uint16_t",
        "uint8_t",
        "uint8_t",
    ]
    ordered_fieldnames: ClassVar[list[str]] = [
        "id",
        "event_time_boot_ms",
        "sequence",
        "destination_component",
        "destination_system",
        "log_levels",
        "arguments",
    ]
    array_lengths: ClassVar[list[int]] = [0, 0, 0, 0, 0, 0, 40]
    lengths: ClassVar[list[int]] = [1, 1, 1, 1, 1, 1, 40]


class Event(MavlinkMessage, frozen=True):
    """EVENT: an event by number; a file that the vehicle serves has its text."""

    message_id: ClassVar[int] = 410
    id: int
    sequence: int
    log_levels: int
    arguments: tuple[int, ...]


class FileTransfer(MavlinkMessage, frozen=True):
    """FILE_TRANSFER_PROTOCOL: one request or answer, 251 bytes (layout in ``files``)."""

    message_id: ClassVar[int] = dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL
    target_network: int
    target_system: int
    target_component: int
    payload: tuple[int, ...]


INCOMING: tuple[type[MavlinkMessage], ...] = (Event, FileTransfer)
OUTGOING: tuple[type[MavlinkMessage], ...] = (FileTransfer,)
