"""Session of one client, which survives its connection: subscriptions, queued and in-flight messages."""

from __future__ import annotations

import math
from collections import deque

import mqtt5
import msgspec

from fleet.sim.broker.limits import ClientLimits

NEVER = 0xFFFF_FFFF
"""Session expiry interval of a session that never expires."""


class BrokerSubscription(msgspec.Struct, frozen=True):
    """One filter of a client, with its options and the subscription identifier sent with each match."""

    options: mqtt5.TopicFilter
    identifier: int | None = None


class QueuedCopy(msgspec.Struct):
    """One message queued for one client; ``deadline`` is its expiry, monotonic seconds."""

    packet: mqtt5.PublishPacket
    qos: int
    retain: bool
    identifiers: list[int]
    deadline: float | None


class BrokerSession:
    """The state that survives a connection (MQTT 5, section 4.1); no I/O, no clock."""

    def __init__(self, client_id: str, limits: ClientLimits) -> None:
        self.client_id = client_id
        self.subscriptions: dict[str, BrokerSubscription] = {}
        self.received: set[int] = set()
        self.expiry = 0
        self.window = 0xFFFF
        self.ends: float | None = None
        self._limits = limits
        self._waiting = 0
        self._last_id = 0
        self._queue: deque[QueuedCopy] = deque()
        self._held: deque[QueuedCopy] = deque()
        self._sent: dict[int, QueuedCopy] = {}
        self._released: dict[int, None] = {}

    def offer(self, copy: QueuedCopy) -> bool:
        """Queue a message; return False if there is no room."""
        size = len(copy.packet.payload)
        if (
            len(self._queue) + len(self._held) >= self._limits.queue
            or self._waiting + size > self._limits.queue_bytes
        ):
            return False
        self._queue.append(copy)
        self._waiting += size
        return True

    def offer_dropping_oldest(self, copy: QueuedCopy) -> None:
        """Queue a message; drop the oldest ones if there is no room."""
        while not self.offer(copy) and (oldest := self._held or self._queue):
            self._take(oldest)

    def send(self, now: float) -> list[mqtt5.Packet]:
        """Return the packets that may be sent to the client now.

        QoS 1 and 2 messages beyond its Receive Maximum are held back, in order; QoS 0 overtakes them.
        """
        packets: list[mqtt5.Packet] = []
        while self._held and self._room():
            self._send(self._take(self._held), packets, now)
        while self._queue:
            copy = self._take(self._queue)
            if copy.qos and (self._held or not self._room()):
                self._held.append(copy)
                self._waiting += len(copy.packet.payload)
            else:
                self._send(copy, packets, now)
        return packets

    def resume(self, now: float) -> list[mqtt5.Packet]:
        """Return the unacknowledged packets for a client that reconnected, in their original order."""
        again = [_packet(copy, identifier, now, again=True) for identifier, copy in self._sent.items()]
        return [*again, *map(mqtt5.PubRelPacket, self._released)]

    def forget(self, identifier: int) -> None:
        """Forget a message that was delivered, or that is too large for the client."""
        self._sent.pop(identifier, None)

    def on_pubrec(self, packet: mqtt5.PubRecPacket) -> mqtt5.PubRelPacket | None:
        """Return PUBREL for a received QoS 2 message; None if the client refused the message."""
        known = self._sent.pop(packet.packet_id, None) is not None or packet.packet_id in self._released
        if int(packet.reason_code) >= 0x80:
            return None
        if known:
            self._released[packet.packet_id] = None
            return mqtt5.PubRelPacket(packet.packet_id)
        return mqtt5.PubRelPacket(packet.packet_id, reason_code=mqtt5.PubRelReasonCode.PACKET_ID_NOT_FOUND)

    def on_pubcomp(self, identifier: int) -> None:
        """Forget a QoS 2 message that is complete."""
        self._released.pop(identifier, None)

    def _take(self, queue: deque[QueuedCopy]) -> QueuedCopy:
        """Remove and return the oldest message of a queue."""
        copy = queue.popleft()
        self._waiting -= len(copy.packet.payload)
        return copy

    def _send(self, copy: QueuedCopy, packets: list[mqtt5.Packet], now: float) -> None:
        """Add a message to the packets, unless it has expired."""
        if copy.deadline is not None and copy.deadline <= now:
            return
        identifier = self._next_id() if copy.qos else None
        if identifier is not None:
            self._sent[identifier] = copy
        packets.append(_packet(copy, identifier, now))

    def _room(self) -> bool:
        """Return True if the client accepts one more QoS 1 or 2 message."""
        return len(self._sent) + len(self._released) < self.window

    def _next_id(self) -> int:
        """Return a free packet identifier."""
        while True:
            self._last_id = self._last_id % 0xFFFF + 1
            if self._last_id not in self._sent and self._last_id not in self._released:
                return self._last_id


def _packet(
    copy: QueuedCopy, identifier: int | None, now: float, *, again: bool = False
) -> mqtt5.PublishPacket:
    """Return PUBLISH for one client: properties as published, expiry reduced by the waiting time."""
    source = copy.packet
    return mqtt5.PublishPacket(
        source.topic,
        source.payload,
        qos=mqtt5.QoS(copy.qos),
        retain=copy.retain,
        packet_id=identifier,
        duplicate=again,
        payload_format_indicator=source.payload_format_indicator,
        message_expiry_interval=None if copy.deadline is None else max(math.ceil(copy.deadline - now), 0),
        content_type=source.content_type,
        response_topic=source.response_topic,
        correlation_data=source.correlation_data,
        subscription_ids=copy.identifiers,
        user_properties=source.user_properties,
    )
