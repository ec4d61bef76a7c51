"""Target of a MAVLink frame, read from its bytes without decoding it."""

from __future__ import annotations

import re
import struct
from typing import Any

from pymavlink.dialects.v20 import all as dialect

_MAGIC_2 = 0xFD
_HEADER_1, _HEADER_2 = 6, 10
_ITEM = re.compile(r"\d*[a-zA-Z]")  # one item of a struct format, with its count: one per field


def _offset(wire: Any, name: str) -> int | None:
    """Return the offset of a field in the payload, None for a message without it."""
    if name not in wire.ordered_fieldnames:
        return None
    items = _ITEM.findall(wire.unpacker.format)
    return sum(struct.calcsize(f"<{item}") for item in items[: wire.ordered_fieldnames.index(name)])


_OFFSETS = {
    number: (offset, _offset(wire, "target_component"))
    for number, wire in dialect.mavlink_map.items()
    if (offset := _offset(wire, "target_system")) is not None
}


def number_of(frame: bytes) -> int:
    """Return the message id of a complete frame."""
    if frame[0] == _MAGIC_2:
        return frame[7] | frame[8] << 8 | frame[9] << 16
    return frame[5]


def target_of(frame: bytes) -> tuple[int, int]:
    """Return target system and component of a complete frame; 0: all of them."""
    offsets = _OFFSETS.get(number_of(frame))
    if offsets is None:
        return 0, 0
    header = _HEADER_2 if frame[0] == _MAGIC_2 else _HEADER_1
    payload = frame[header : header + frame[1]]
    return _byte(payload, offsets[0]), _byte(payload, offsets[1])


def _byte(payload: bytes, at: int | None) -> int:
    """Return a byte of a payload; trailing zeros are not sent."""
    return payload[at] if at is not None and at < len(payload) else 0
