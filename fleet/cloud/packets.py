"""Encodes and decodes MQTT packets of both protocol versions, and guards against defects of the codec.

A packet is decoded only once it is complete, so "not enough bytes" inside one is an error, not a wait. The
codec panics on text that is not UTF-8 and prints a page on stderr: such a packet is refused before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, Literal, TypeVar

import mqtt5

from fleet.cloud import v311
from fleet.cloud.utf8 import has_broken_text
from fleet.errors import WireError

Protocol = Literal[5, 311]
ReadT = TypeVar("ReadT")

_CONNECT = 1
MORE = 0x80  # continuation bit of a length byte
_V311_REFUSAL = b"\x20\x02\x00\x01"
"""Answer of a broker without MQTT 5 to an MQTT 5 CONNECT; the MQTT 5 codec cannot decode it."""


def encode(packet: mqtt5.Packet, protocol: Protocol) -> bytes:
    """Return the bytes of a packet; raise ValueError if the protocol has no such packet."""
    return packet.write() if protocol == 5 else v311.write(packet)


def frame_length(data: bytes, start: int = 0) -> int | None:
    """Return the length of the frame at ``start``, None if too few bytes are known.

    Raises WireError for a length field of more than four bytes.
    """
    size = 0
    for place, byte in enumerate(data[start + 1 : start + 5]):
        size |= (byte & 0x7F) << 7 * place
        if byte < MORE:
            return place + 2 + size
    if len(data) >= start + 5:
        raise WireError("a packet's length field is longer than four bytes")
    return None


class PacketTooLarge(WireError):
    """A packet is above the limit; ``head`` has its first bytes."""

    def __init__(self, message: str, head: bytes) -> None:
        super().__init__(message)
        self.head = head


class PacketFramer(Generic[ReadT]):
    """Splits a byte stream into packets and keeps the incomplete rest.

    ``read`` decodes a packet from a buffer, its start and its end; ``limit`` is the largest packet in bytes.
    For a larger one, the first ``head`` bytes are collected for the error.
    """

    def __init__(self, read: Callable[[bytes, int, int], ReadT], limit: int, *, head: int = 0) -> None:
        self._read = read
        self._limit = limit
        self._head = head
        self._rest = bytearray()
        self._needed = 0

    def feed(self, data: bytes) -> Iterator[ReadT]:
        """Yield the packets that the bytes complete; raise WireError at the first invalid one."""
        if self._rest:
            self._rest += data
            if len(self._rest) < self._needed:
                return
            data = bytes(self._rest)
            self._rest.clear()
        start, known = 0, len(data)
        while start < known and (end := self._end(data, start, known)) is not None:
            yield self._read(data, start, end)
            start = end
        self._rest += data[start:]

    def _end(self, data: bytes, start: int, known: int) -> int | None:
        """Return the end of the frame, None if it is incomplete; then record how many bytes it needs.

        ``known`` is the length of ``data``.
        """
        length = frame_length(data, start)
        if length is None:
            self._needed = 0
            return None
        if length > self._limit:
            if known - start < min(length, self._head):
                self._needed = min(length, self._head)
                return None
            head = data[start : start + self._head]
            raise PacketTooLarge(f"a packet of {length} bytes, larger than {self._limit}", head)
        self._needed = length
        return start + length if start + length <= known else None


class PacketDecoder(PacketFramer[mqtt5.Packet]):
    """Decodes a byte stream.

    Without a protocol, the first packet must be CONNECT, which selects it (the broker's side).
    """

    def __init__(self, protocol: Protocol | None, limit: int) -> None:
        super().__init__(self._decode, limit)
        self.protocol = protocol

    def _decode(self, data: bytes, start: int, end: int) -> mqtt5.Packet:
        """Decode one complete frame."""
        if self.protocol is None:
            self.protocol = _version_of(memoryview(data)[start:end])
        return decode(data, start, end, self.protocol)


def _version_of(frame: memoryview) -> Protocol:
    """Return the protocol version in a CONNECT: the byte behind the protocol name."""
    head = bytes(frame[:12])
    if head[0] >> 4 != _CONNECT:
        raise WireError("the first packet is not CONNECT")
    name = head.find(b"\x00\x04MQTT")
    level = head[name + 6] if 1 < name <= 5 and name + 6 < len(head) else 0
    if level not in (4, 5):
        raise WireError("the client speaks neither MQTT 5 nor MQTT 3.1.1")
    return 5 if level == 5 else 311


def decode(data: bytes, start: int, end: int, protocol: Protocol) -> mqtt5.Packet:
    """Decode one complete frame; raise WireError if it is invalid, for every error of the codecs."""
    frame = memoryview(data)[start:end]
    if protocol == 5 and has_broken_text(frame):
        raise WireError("not an MQTT packet: a text is not UTF-8")
    try:
        packet, length = mqtt5.read(frame) if protocol == 5 else (v311.read(frame), end - start)
    except (ValueError, IndexError) as error:
        if protocol == 5 and frame == _V311_REFUSAL:
            return mqtt5.ConnAckPacket(reason_code=mqtt5.ConnAckReasonCode.UNSUPPORTED_PROTOCOL_VERSION)
        raise WireError(f"not an MQTT packet: {error}") from None
    except BaseException as error:
        # A panic of the codec derives from BaseException, and its class is not public.
        if type(error).__name__ != "PanicException":
            raise
        raise WireError("not an MQTT packet: the codec panicked over it") from None
    if length != end - start:
        raise WireError("not an MQTT packet: it has bytes after its end")
    match packet:
        case mqtt5.PublishPacket(topic=topic) if "+" in topic or "#" in topic or "\0" in topic:
            raise WireError("a message to a topic with a wildcard or a NUL in it")
    if getattr(packet, "packet_id", None) == 0:
        raise WireError("a packet with the identifier 0")
    return packet
