"""PUBLISH from what waits to be sent, for both protocol versions."""

from __future__ import annotations

import functools
import math

import mqtt5
import msgspec

from fleet.cloud.packets import Protocol, encode
from fleet.cloud.topics import check_topic
from fleet.spool.message import Outgoing

_LONGEST = 0xFFFF_FFFF  # s
_QOS = tuple(map(mqtt5.QoS, range(3)))


def publish(message: Outgoing, identifier: int, now: float, protocol: Protocol) -> bytes:
    """Return the packet of a message of QoS 1 or 2, at the monotonic time ``now``.

    Raises ValueError or TypeError for what MQTT cannot carry.
    """
    packet = mqtt5.PublishPacket(
        message.topic,
        message.payload,
        qos=_QOS[message.qos],
        duplicate=message.again,
        packet_id=identifier,
        message_expiry_interval=None if message.deadline is None else _whole(message.deadline - now),
        content_type=message.content_type,
        correlation_data=message.correlation,
    )
    return encode(packet, protocol)


class PublishRoute(msgspec.Struct, frozen=True, gc=False):
    """Where messages of QoS 0 go; ``expiry`` is how many seconds they are worth sending, None: always."""

    topic: str
    expiry: float | None


@functools.lru_cache(maxsize=16384)  # an edge says the same few topics again and again
def publish_route(topic: str, expiry: float | None) -> PublishRoute:
    """Return where messages go; raise ValueError for a topic that no message can be published to."""
    return PublishRoute(check_topic(topic), expiry)


class QueuedQos0(msgspec.Struct, frozen=True, gc=False):
    """A message of QoS 0 that waits; ``since`` is when (monotonic s) it was queued."""

    where: PublishRoute
    payload: bytes
    since: float

    def is_late(self, now: float) -> bool:
        """Tell whether it is not worth sending any more."""
        return self.where.expiry is not None and now - self.since >= self.where.expiry


def publish_light(message: QueuedQos0, now: float, protocol: Protocol) -> bytes:
    """Return the packet of a message of QoS 0, with what is left of its time.

    Raises ValueError or TypeError for what MQTT cannot carry.
    """
    where = message.where
    packet = mqtt5.PublishPacket(
        where.topic,
        message.payload,
        message_expiry_interval=None if where.expiry is None else _whole(message.since + where.expiry - now),
    )
    return encode(packet, protocol)


def _whole(left: float) -> int:
    """Return how many seconds are left of a message's time, rounded up; never none."""
    return min(max(math.ceil(left), 1), _LONGEST)
