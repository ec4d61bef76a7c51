"""Decodes packets from the broker, and recovers topic and payload of a malformed PUBLISH.

A malformed message may be a stop, so it is not discarded unread.
"""

from __future__ import annotations

from collections.abc import Callable

import mqtt5

from fleet.cloud.packets import MORE, PacketTooLarge, Protocol, decode
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError

_PUBLISH = 3  # packet type: the high four bits of the first byte
_QOS = 0x06  # the QoS bits of the first byte


HEAD = 1024  # bytes of an oversized packet that are read for its topic


class MalformedPublish(WireError):
    """A PUBLISH that cannot be decoded; ``message`` has the parts that could be recovered."""

    def __init__(self, error: WireError, message: CloudMessage) -> None:
        super().__init__(str(error))
        self.message = message


def reader(protocol: Protocol) -> Callable[[bytes, int, int], mqtt5.Packet]:
    """Return the decoder of packets; it raises WireError, for a malformed PUBLISH MalformedPublish."""

    def read(data: bytes, start: int, end: int) -> mqtt5.Packet:
        try:
            return decode(data, start, end, protocol)
        except WireError as error:
            message = _lenient_publish(data[start:end], protocol, str(error))
            if message is None:
                raise
            raise MalformedPublish(error, message) from None

    return read


def recover_publish(error: WireError) -> CloudMessage | None:
    """Return the message recovered from a packet that cannot be decoded, None if there is none.

    It may only be used as a stop. Of an oversized one only the topic is known.
    """
    if isinstance(error, MalformedPublish):
        return error.message
    if not isinstance(error, PacketTooLarge):
        return None
    topic, _ = _topic(error.head)
    return CloudMessage(topic, b"", flaw=str(error)) if topic else None


def _lenient_publish(packet: bytes, protocol: Protocol, why: str) -> CloudMessage | None:
    """Decode a PUBLISH leniently; None for any other packet, and for one without a topic."""
    topic, at = _topic(packet)
    if not topic:
        return None
    at += 2 * bool(packet[0] & _QOS)
    if protocol == 5:
        size, length = 0, MORE
        for place in range(4):
            if length & MORE and at < len(packet):
                length, at = packet[at], at + 1
                size |= (length & ~MORE) << 7 * place
        at += size
    return CloudMessage(topic, packet[at:], flaw=why)


def _topic(packet: bytes) -> tuple[str, int]:
    """Return topic and end of the topic of a PUBLISH, ``("", 0)`` if it has none."""
    if packet[0] >> 4 != _PUBLISH:
        return "", 0
    at = 1
    while at < min(len(packet), 4) and packet[at] & MORE:
        at += 1
    start = at + 3
    end = start + int.from_bytes(packet[at + 1 : start])
    return (packet[start:end].decode(errors="replace"), end) if end <= len(packet) else ("", 0)
