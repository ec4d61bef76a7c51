"""What a broker sends a client, packet by packet.

A message of the usual form is read here, at once: the codec and its packet take several times as long, and a
command waits meanwhile. Whatever is unusual about one, or wrong, is the codec's.
"""

from __future__ import annotations

from collections.abc import Callable

import mqtt5
import msgspec

from fleet.cloud.packets import MORE, Protocol, decode
from fleet.cloud.values import Message

_USUAL = {0x30: 0, 0x32: 1}
"""The QoS of a PUBLISH, by its first byte; none of these was kept, or is sent again."""


class Publish(msgspec.Struct, frozen=True):
    """A message without properties; ``identifier`` is what it is acknowledged by, 0 with QoS 0."""

    message: Message
    identifier: int


Arrival = mqtt5.Packet | Publish


def reader(protocol: Protocol) -> Callable[[bytes, int, int], Arrival]:
    """Return what reads a packet; it raises WireError for what is none."""
    return _arrival5 if protocol == 5 else _arrival311


def _arrival311(data: bytes, start: int, end: int) -> Arrival:
    """Read a packet of MQTT 3.1.1."""
    return decode(data, start, end, 311)


def _arrival5(data: bytes, start: int, end: int) -> Arrival:
    """Read a packet of MQTT 5."""
    qos = _USUAL.get(data[start])
    plain = None if qos is None else _plain(data, start + 1, end, qos)
    return decode(data, start, end, 5) if plain is None else plain


def _plain(data: bytes, at: int, end: int, qos: int) -> Publish | None:
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
    return Publish(Message(topic, data[body + 1 : end], qos), identifier)
