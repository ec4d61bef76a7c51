"""What a broker sends a client, packet by packet; of a damaged message, what can be told of it.

A damaged message may be a stop, so it is not thrown away unread.
"""

from __future__ import annotations

from collections.abc import Callable

import mqtt5

from fleet.cloud.packets import MORE, PacketTooLarge, Protocol, decode
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError

_PUBLISH = 3  # the first half of the first byte
_QOS = 0x06  # the bits of the QoS in it


HEAD = 1024  # bytes of a packet that is too large in which its topic stands


class MalformedPublish(WireError):
    """A packet that is none, but a message by its first byte; ``message`` is what can be told of that."""

    def __init__(self, error: WireError, message: CloudMessage) -> None:
        super().__init__(str(error))
        self.message = message


def reader(protocol: Protocol) -> Callable[[bytes, int, int], mqtt5.Packet]:
    """Return what reads a packet; it raises WireError for what is none, Damaged for such a message."""

    def read(data: bytes, start: int, end: int) -> mqtt5.Packet:
        try:
            return decode(data, start, end, protocol)
        except WireError as error:
            message = _salvaged(data[start:end], protocol, str(error))
            if message is None:
                raise
            raise MalformedPublish(error, message) from None

    return read


def recover_publish(error: WireError) -> CloudMessage | None:
    """Return the message in bytes that the broker should not have sent; None where there is none.

    Nothing but a stop may be made of it. Of one that is too large only the topic is known.
    """
    if isinstance(error, MalformedPublish):
        return error.message
    if not isinstance(error, PacketTooLarge):
        return None
    topic, _ = _topic(error.head)
    return CloudMessage(topic, b"", flaw=str(error)) if topic else None


def _salvaged(packet: bytes, protocol: Protocol, why: str) -> CloudMessage | None:
    """Read a PUBLISH as kindly as can be; None for any other packet, and for one without a topic."""
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
    """Return the topic of a PUBLISH and where it ends; an empty one where there is none."""
    if packet[0] >> 4 != _PUBLISH:
        return "", 0
    at = 1
    while at < min(len(packet), 4) and packet[at] & MORE:
        at += 1
    start = at + 3
    end = start + int.from_bytes(packet[at + 1 : start])
    return (packet[start:end].decode(errors="replace"), end) if end <= len(packet) else ("", 0)
