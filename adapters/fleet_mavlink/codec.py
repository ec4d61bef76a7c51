"""Codec for MAVLink 1 and 2 frames, to and from typed messages.

Message layouts are those of pymavlink's dialect ``all``. Framing and checksums are implemented here, which is
five times faster than pymavlink's parser and skips unwanted messages before they are decoded.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import Any

import msgspec
from fastcrc import crc16
from pymavlink.dialects.v20 import all as dialect

from fleet_mavlink import (
    broadcast_messages,
    event_messages,
    messages,
    mission_messages,
    payload_messages,
    transfer_messages,
)
from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.signing import SIGNATURE_BYTES, Signer

_MAGIC_1 = 0xFE
_MAGIC_2 = 0xFD
_BEGIN_2 = bytes([_MAGIC_2])
_MAGICS = b"\xfd\xfe"
_MAGIC = re.compile(b"[\xfd\xfe]")
_HEADER_1 = 6
_HEADER_2 = 10
_UNKNOWN_LENGTH = -1  # length not known yet
_SIGNED = 0x01  # the only incompatibility flag in the specification
_LAST_OF_1 = 255  # the largest message id in MAVLink 1
_SIZES = {
    "char": 1,
    "uint8_t": 1,
    "int8_t": 1,
    "uint16_t": 2,
    "int16_t": 2,
    "uint32_t": 4,
    "int32_t": 4,
    "float": 4,
    "uint64_t": 8,
    "int64_t": 8,
    "double": 8,
}
_HEAD = struct.Struct("<BBBBBBBH")  # of MAVLink 2; the last two are the message id, low byte first
_WIRES: dict[int, Any] = {**dialect.mavlink_map, event_messages.Event.message_id: event_messages.EventWire}
_CRC_EXTRA = {number: bytes([kind.crc_extra]) for number, kind in _WIRES.items()}


class UndecodedMessage(MavlinkMessage, frozen=True):
    """Placeholder for a message that is not decoded here."""


UNREAD = UndecodedMessage()


class Frame(msgspec.Struct, frozen=True):
    """A decoded message and its sender; ``signed``: the whole frame if signed; ``raw``: the whole frame.

    Only where every frame was requested, ``raw`` is kept and the message may be ``UNREAD``.
    """

    system: int
    component: int
    message: MavlinkMessage
    version: int = 2
    signed: bytes = b""
    raw: bytes = b""


class _MessageLayout:
    """Layout of one message's fields in its payload."""

    def __init__(self, kind: type[MavlinkMessage]) -> None:
        wire = _WIRES[kind.message_id]
        self.kind = kind
        self.crc_extra = _CRC_EXTRA[kind.message_id]
        self.base_size = _base_size(wire)
        self._packing = struct.Struct(kind.packing) if kind.packing else wire.unpacker
        self._blank = self._packing.unpack(bytes(self._packing.size))
        self._places = {name: _place(wire, index) for index, name in enumerate(wire.ordered_fieldnames)}
        self._wanted = tuple((name, self._places[name]) for name in kind.__struct_fields__)
        places = [place for _, place in self._wanted]
        numbers = all(place.stop - place.start == 1 for place in places) and not self._has_text(wire)
        # Numbers are picked from the unpacked values in one call, and put into wire order in one.
        indexes = [place.start for place in places] if numbers else []
        rest = [index for index in range(len(self._blank)) if index not in indexes]
        self._pick = _picker(indexes)
        self._order = _picker([[*indexes, *rest].index(index) for index in range(len(self._blank))])
        self._rest = tuple(self._blank[index] for index in rest)

    def _has_text(self, wire: Any) -> bool:
        """Return True if one of the wanted fields is a text."""
        texts = dict(zip(wire.ordered_fieldnames, _texts(wire), strict=True))
        return any(texts[name] for name, _ in self._wanted)

    def decode(self, payload: bytes) -> MavlinkMessage:
        """Decode a payload; MAVLink 2 truncates trailing zeros, and a newer dialect appends fields."""
        size = self._packing.size
        values = self._packing.unpack(payload[:size].ljust(size, b"\0"))
        if self._pick is not None:
            return self.kind(*self._pick(values))
        return self.kind(**{name: _value(values[place]) for name, place in self._wanted})

    def encode(self, message: MavlinkMessage) -> bytes:
        """Encode a message to a payload without trailing zeros (at least one byte)."""
        if self._pick is not None and self._order is not None:
            values: Sequence[object] = self._order(msgspec.structs.astuple(message) + self._rest)
        else:
            values = list(self._blank)
            for name, place in self._wanted:
                values[place] = _wire_values(getattr(message, name))
        return self._packing.pack(*values).rstrip(b"\0") or b"\0"


def _picker(indexes: Sequence[int]) -> Callable[[Sequence[object]], tuple[object, ...]] | None:
    """Return a function that picks the values at these indexes, None for fewer than two."""
    return itemgetter(*indexes) if len(indexes) > 1 else None


def _base_size(wire: Any) -> int:
    """Return the size of a payload without extension fields: the part that ``crc_extra`` covers.

    MAVLink 1 has no extensions, and a fixed length for each message.
    """
    kinds = dict(zip(wire.fieldnames, wire.fieldtypes, strict=True))
    described = f"{wire.msgname} ".encode()
    size = 0
    for name, length in zip(wire.ordered_fieldnames, wire.array_lengths, strict=True):
        kind = kinds[name]
        described += f"{kind} {name} ".encode() + (bytes([length]) if length else b"")
        size += _SIZES[kind] * max(int(length), 1)
        folded = crc16.mcrf4xx(described)
        if (folded & 0xFF) ^ (folded >> 8) == int(wire.crc_extra):
            return size
    raise ValueError(f"{wire.msgname}: its fields do not give its crc_extra")


def _place(wire: Any, index: int) -> slice:
    """Return the slice of the unpacked values that belongs to a field; a text is one value."""
    counts = [1 if text else length for length, text in zip(wire.lengths, _texts(wire), strict=True)]
    start = sum(counts[:index])
    return slice(start, start + counts[index])


def _texts(wire: Any) -> list[bool]:
    """Return for each field, in wire order, whether it is a text."""
    kinds = dict(zip(wire.fieldnames, wire.fieldtypes, strict=True))
    return [kinds[name] == "char" for name in wire.ordered_fieldnames]


def _value(values: tuple[object, ...]) -> object:
    """Return a number, a text up to its NUL, or a tuple for an array."""
    if len(values) > 1:
        return values
    value = values[0]
    if isinstance(value, bytes):
        return value.partition(b"\0")[0].decode("utf-8", "replace")
    return value


def _wire_values(value: object) -> tuple[object, ...]:
    """Return the wire values of a field: its numbers, or its text as bytes."""
    if isinstance(value, tuple):
        return value
    return (value.encode() if isinstance(value, str) else value,)


def is_read(number: int) -> bool:
    """Return True if messages with this id are decoded here."""
    return number in _READ


_MODULES = (
    broadcast_messages,
    event_messages,
    messages,
    mission_messages,
    payload_messages,
    transfer_messages,
)
_READ = {kind.message_id: _MessageLayout(kind) for module in _MODULES for kind in module.INCOMING}
_WRITE = {kind.message_id: _MessageLayout(kind) for module in _MODULES for kind in module.OUTGOING}


class FrameSettings(msgspec.Struct, frozen=True):
    """Settings of the frames for one vehicle: MAVLink version, signer, and our link id."""

    version: int = 2
    signer: Signer | None = None
    link: int = 0


PLAIN = FrameSettings()


def pack(
    message: MavlinkMessage, system: int, component: int, sequence: int, settings: FrameSettings = PLAIN
) -> bytes:
    """Return the frame of an outgoing message, from this system and component.

    A peer that uses version 1 receives version 1; messages that version 1 lacks are sent in version 2.
    """
    number = message.message_id
    layout = _WRITE[number]
    payload = layout.encode(message)
    if settings.version == 1 and number <= _LAST_OF_1:
        payload = payload.ljust(layout.base_size, b"\0")[: layout.base_size]
        body = struct.pack("<BBBBB", len(payload), sequence & 0xFF, system, component, number) + payload
        return bytes([_MAGIC_1]) + body + _checksum(body, layout.crc_extra)
    flags = 0 if settings.signer is None else _SIGNED
    place = (sequence & 0xFF, system, component, number & 0xFF, number >> 8)
    body = _HEAD.pack(len(payload), flags, 0, *place) + payload
    frame = _BEGIN_2 + body + _checksum(body, layout.crc_extra)
    return frame if settings.signer is None else frame + settings.signer.signature(frame, settings.link)


def _checksum(body: bytes, crc_extra: bytes) -> bytes:
    """Return the checksum, the last two bytes of a frame."""
    return crc16.mcrf4xx(body + crc_extra).to_bytes(2, "little")


class Packer:
    """Encodes the frames of one station, with their sequence numbers; for one thread."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self._sequence = 0

    def pack(self, message: MavlinkMessage, settings: FrameSettings = PLAIN) -> bytes:
        """Return the frame of a message."""
        self._sequence = (self._sequence + 1) & 0xFF
        return pack(message, self.system, self.component, self._sequence, settings)


class Parser:
    """Splits one stream of bytes into frames; skips garbage, keeps at most one partial frame.

    Only a frame with a valid checksum is accepted. A message unknown to the dialect has none that can be
    verified, so it is never accepted, and its bytes cannot be mistaken for a vehicle's id.
    """

    def __init__(self) -> None:
        self.broken = 0  # frames with a wrong checksum
        self._rest = b""

    def feed(self, data: bytes, *, every: bool = False) -> list[Frame]:
        """Process received bytes; return the wanted messages that they complete, or every frame."""
        buffer = self._rest + data
        frames: list[Frame] = []
        at, length = 0, len(buffer)
        while at < length:
            if buffer[at] not in _MAGICS:
                found = _MAGIC.search(buffer, at)
                at = found.start() if found else length
                continue
            size, number = _head(buffer, at, length)
            end = at + size
            if size == _UNKNOWN_LENGTH or end > length:
                break
            if size and not every and _is_unwanted(buffer, at, end, number):
                at = end
            elif size and _is_intact(buffer, at, end, number):
                if every:
                    frames.append(_whole(buffer[at:end], number))
                elif number in _READ:
                    frames.append(_decoded(buffer[at:end], number))
                at = end
            else:
                self.broken += size > 0
                at += 1
        self._rest = buffer[at:]
        return frames


def _head(buffer: bytes, at: int, length: int) -> tuple[int, int]:
    """Return the length of the frame that starts here, and its message id.

    The length is 0 if no frame can start here, and _UNTOLD while there are too few bytes.
    """
    left = length - at
    if left < _HEADER_1:
        return _UNKNOWN_LENGTH, 0
    if buffer[at] == _MAGIC_1:
        return _HEADER_1 + buffer[at + 1] + 2, buffer[at + 5]
    flags = buffer[at + 2]
    if flags & ~_SIGNED:
        return 0, 0
    if left < _HEADER_2:
        return _UNKNOWN_LENGTH, 0
    number = buffer[at + 7] | buffer[at + 8] << 8 | buffer[at + 9] << 16
    if number not in _CRC_EXTRA:
        return 0, 0
    return _HEADER_2 + buffer[at + 1] + 2 + (SIGNATURE_BYTES if flags else 0), number


def _is_unwanted(buffer: bytes, at: int, end: int, number: int) -> bool:
    """Return True for an unwanted MAVLink 2 frame with another start or nothing after it: skip its CRC."""
    if number in _READ or buffer[at] == _MAGIC_1:
        return False
    return end == len(buffer) or buffer[end] in _MAGICS


def _is_intact(buffer: bytes, at: int, end: int, number: int) -> bool:
    """Return True if the checksum of a complete frame is correct."""
    if buffer[at] == _MAGIC_2 and buffer[at + 2]:
        end -= SIGNATURE_BYTES
    crc_extra = _CRC_EXTRA.get(number)
    return crc_extra is not None and _checksum(buffer[at + 1 : end - 2], crc_extra) == buffer[end - 2 : end]


def _whole(frame: bytes, number: int) -> Frame:
    """Return an intact frame with its bytes; its message is decoded if wanted."""
    if number in _READ:
        return msgspec.structs.replace(_decoded(frame, number), raw=frame)
    if frame[0] == _MAGIC_1:
        return Frame(frame[3], frame[4], UNREAD, 1, raw=frame)
    return Frame(frame[5], frame[6], UNREAD, 2, frame if frame[2] else b"", frame)


def _decoded(frame: bytes, number: int) -> Frame:
    """Return an intact frame with its decoded message."""
    layout, size = _READ[number], frame[1]
    if frame[0] == _MAGIC_1:
        message = layout.decode(frame[_HEADER_1 : _HEADER_1 + size])
        return Frame(frame[3], frame[4], message, 1)
    message = layout.decode(frame[_HEADER_2 : _HEADER_2 + size])
    return Frame(frame[5], frame[6], message, 2, frame if frame[2] else b"")
