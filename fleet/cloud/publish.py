"""PUBLISH as bytes. It is nearly all that an edge writes, and twice as fast by hand as by the codec."""

from __future__ import annotations

import functools
import math
import struct

import msgspec

from fleet.cloud.fields import binary, length, text
from fleet.cloud.packets import Protocol
from fleet.cloud.topics import check_topic
from fleet.spool.message import Outgoing

_PUBLISH = 0x30
_LIGHT = _PUBLISH.to_bytes()  # QoS 0
_DUPLICATE = 0x08
_FIRST = [[(_PUBLISH | again | qos << 1).to_bytes() for qos in range(3)] for again in (0, _DUPLICATE)]
"""The first byte, by whether it was sent before and QoS."""
_EXPIRY, _CONTENT_TYPE, _CORRELATION = b"\x02", b"\x03", b"\x09"
_NO_PROPERTIES = b"\0"
_ONLY_EXPIRY = b"\x05" + _EXPIRY
_USUAL = struct.Struct(">H2sI")  # identifier, and how long it is worth sending
_LONGEST = 0xFFFF_FFFF  # s

_topic = functools.lru_cache(maxsize=16384)(text)  # an edge says the same few topics again and again


def publish(message: Outgoing, identifier: int, now: float, protocol: Protocol) -> bytes:
    """Return the packet of a message of QoS 1 or 2, at the monotonic time ``now``.

    Raises ValueError or TypeError for what MQTT cannot carry.
    """
    topic, payload = _topic(message.topic), message.payload
    middle = _middle(message, identifier, now, protocol)
    first = _FIRST[message.again][message.qos]
    return b"".join((first, length(len(topic) + len(middle) + len(payload)), topic, middle, payload))


def _middle(message: Outgoing, identifier: int, now: float, protocol: Protocol) -> bytes:
    """Return what stands between topic and payload."""
    if protocol != 5:
        return identifier.to_bytes(2)
    if message.deadline is None or message.content_type is not None or message.correlation is not None:
        return identifier.to_bytes(2) + _properties(message, now)
    return _USUAL.pack(identifier, _ONLY_EXPIRY, _whole(message.deadline - now))


class PublishRoute(msgspec.Struct, frozen=True, gc=False):
    """Where messages of QoS 0 go: the topic, and ``head``, what stands between length and payload.

    ``expiry`` is how many seconds they are worth sending, None: always. For the first ``steady`` of them the
    whole seconds that ``head`` tells are right.
    """

    topic: str
    head: bytes
    expiry: float | None
    steady: float


@functools.lru_cache(maxsize=16384)
def publish_route(topic: str, expiry: float | None, protocol: Protocol) -> PublishRoute:
    """Return where messages go that are worth sending for ``expiry`` seconds, None: always.

    Raises ValueError for a topic that no message can be published to.
    """
    name = text(check_topic(topic))
    if protocol != 5:
        return PublishRoute(topic, name, expiry, math.inf if expiry is None else expiry)
    if expiry is None:
        return PublishRoute(topic, name + _NO_PROPERTIES, None, math.inf)
    seconds = _whole(expiry)
    return PublishRoute(topic, name + _lasting(seconds), expiry, expiry - seconds + 1)


def publish_light(where: PublishRoute, payload: bytes) -> bytes:
    """Return the packet of a message of QoS 0; raise TypeError for a payload that is not bytes."""
    head = where.head
    return b"".join((_LIGHT, length(len(head) + len(payload)), head, payload))


def renewed(where: PublishRoute, packet: bytes, waited: float) -> bytes | None:
    """Return a packet that has waited for some seconds, with what is left of its time; None: nothing is."""
    if where.expiry is None or waited < where.steady:
        return packet
    left = where.expiry - waited
    if left <= 0:
        return None
    payload = packet.partition(where.head)[2]
    head = text(where.topic) + _lasting(_whole(left))
    return publish_light(msgspec.structs.replace(where, head=head), payload)


def _lasting(seconds: int) -> bytes:
    """Return the properties that tell how many seconds are left, and nothing else."""
    return _ONLY_EXPIRY + seconds.to_bytes(4)


def _whole(left: float) -> int:
    """Return how many seconds are left of a message's time, rounded up; never none."""
    return min(max(math.ceil(left), 1), _LONGEST)


def _properties(message: Outgoing, now: float) -> bytes:
    """Return the properties of MQTT 5."""
    expiry = b"" if message.deadline is None else _whole(message.deadline - now).to_bytes(4)
    properties = _EXPIRY + expiry if expiry else b""
    if message.content_type is not None:
        properties += _CONTENT_TYPE + text(message.content_type)
    if message.correlation is not None:
        properties += _CORRELATION + binary(message.correlation)
    return length(len(properties)) + properties
