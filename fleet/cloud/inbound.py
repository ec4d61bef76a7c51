"""What a broker sends a client, packet by packet.

A message of the usual form is read here, at once: the codec and its packet take several times as long, and a
command waits meanwhile. Whatever is unusual about one, or wrong, is the codec's.
"""

from __future__ import annotations

from collections.abc import Callable

import mqtt5
import msgspec

from fleet.cloud.packets import MORE, PacketTooLarge, Protocol, decode
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError

_USUAL = {0x30: 0, 0x32: 1}
"""The QoS of a PUBLISH, by its first byte; none of these was kept, or is sent again."""
_PUBLISH = 3  # the first half of the first byte
_QOS = 0x06  # the bits of the QoS in it


class InboundPublish(msgspec.Struct, frozen=True):
    """A message without properties; ``identifier`` is what it is acknowledged by, 0 with QoS 0."""

    message: CloudMessage
    identifier: int


Arrival = mqtt5.Packet | InboundPublish
HEAD = 1024  # bytes of a packet that is too large in which its topic stands


class MalformedPublish(WireError):
    """A packet that is none, but a message by its first byte; ``message`` is what can be told of that."""

    def __init__(self, error: WireError, message: CloudMessage) -> None:
        super().__init__(str(error))
        self.message = message


def reader(protocol: Protocol) -> Callable[[bytes, int, int], Arrival]:
    """Return what reads a packet; it raises WireError for what is none."""
    return _arrival5 if protocol == 5 else _arrival311


def _arrival311(data: bytes, start: int, end: int) -> Arrival:
    """Read a packet of MQTT 3.1.1."""
    return _decoded(data, start, end, 311)


def _arrival5(data: bytes, start: int, end: int) -> Arrival:
    """Read a packet of MQTT 5."""
    qos = _USUAL.get(data[start])
    plain = None if qos is None else _plain(data, start + 1, end, qos)
    return _decoded(data, start, end, 5) if plain is None else plain


def _plain(data: bytes, at: int, end: int, qos: int) -> InboundPublish | None:
    """Read a PUBLISH from its length on (MQTT 5, section 3.3); None for one that is the codec's."""
    first = at
    while data[at] & MORE:
        at += 1
    name = at + 3
    if name > end or (at > first and not data[at]):  # the length has a byte too many
        return None
    rest = name + (data[at + 1] << 8 | data[at + 2])
    body = rest + 2 * qos
    if body >= end or data[body]:  # it is cut short, or has properties
        return None
    identifier = data[rest] << 8 | data[rest + 1] if qos else 0
    try:
        topic = data[name:rest].decode()
    except UnicodeDecodeError:
        return None
    if (qos and not identifier) or not topic or "+" in topic or "#" in topic or "\0" in topic:
        return None
    return InboundPublish(CloudMessage(topic, data[body + 1 : end], qos), identifier)


def _decoded(data: bytes, start: int, end: int, protocol: Protocol) -> mqtt5.Packet:
    """Have the codec read a packet; raises Damaged for a message that it refuses, WireError for the rest."""
    try:
        return decode(data, start, end, protocol)
    except WireError as error:
        message = _salvaged(data[start:end], protocol, str(error))
        if message is None:
            raise
        raise MalformedPublish(error, message) from None


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
