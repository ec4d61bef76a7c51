"""PUBLISH packets of queued messages, for both protocol versions."""

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
    """Return the packet of a QoS 1 or 2 message at the monotonic time ``now``.

    Raises ValueError or TypeError for content that MQTT cannot carry.
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


class Qos0Route(msgspec.Struct, frozen=True, gc=False):
    """Publish route of QoS 0 messages; ``expiry`` is their lifetime in seconds, None for no limit."""

    topic: str
    expiry: float | None


@functools.lru_cache(maxsize=16384)  # an edge publishes on the same few topics
def qos0_route(topic: str, expiry: float | None) -> Qos0Route:
    """Return the route of a topic; raise ValueError if no message can be published to it."""
    return Qos0Route(check_topic(topic), expiry)


class QueuedQos0(msgspec.Struct, frozen=True, gc=False):
    """A queued QoS 0 message; ``since`` is the monotonic time of queueing in seconds."""

    route: Qos0Route
    payload: bytes
    since: float

    def is_late(self, now: float) -> bool:
        """Return whether the message has expired."""
        return self.route.expiry is not None and now - self.since >= self.route.expiry


def publish_qos0(message: QueuedQos0, now: float, protocol: Protocol) -> bytes:
    """Return the packet of a QoS 0 message with its remaining lifetime.

    Raises ValueError or TypeError for content that MQTT cannot carry.
    """
    route = message.route
    packet = mqtt5.PublishPacket(
        route.topic,
        message.payload,
        message_expiry_interval=None if route.expiry is None else _whole(message.since + route.expiry - now),
    )
    return encode(packet, protocol)


def _whole(left: float) -> int:
    """Return the remaining seconds of a message's lifetime, rounded up; at least 1."""
    return min(max(math.ceil(left), 1), _LONGEST)
