"""What the broker knows about one client beyond its connection: subscriptions, and messages on their way."""

from __future__ import annotations

import math
from collections import deque

import mqtt5
import msgspec

from fleet.sim.broker.limits import ClientLimits

NEVER = 0xFFFF_FFFF
"""The session expiry of a session that stays."""


class Subscription(msgspec.Struct, frozen=True):
    """One filter of a client, with its options and the identifier that goes along with every match."""

    options: mqtt5.TopicFilter
    identifier: int | None = None


class QueuedCopy(msgspec.Struct):
    """One message on its way to one client; ``deadline`` is monotonic seconds."""

    packet: mqtt5.PublishPacket
    qos: int
    retain: bool
    identifiers: list[int]
    deadline: float | None


class BrokerSession:
    """The state that outlives a connection (MQTT 5, section 4.1); no I/O, no clock."""

    def __init__(self, client_id: str, limits: ClientLimits) -> None:
        self.client_id = client_id
        self.subscriptions: dict[str, Subscription] = {}
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
        """Queue a message; tell whether there was room."""
        size = len(copy.packet.payload)
        if (
            len(self._queue) + len(self._held) >= self._limits.queue
            or self._waiting + size > self._limits.queue_bytes
        ):
            return False
        self._queue.append(copy)
        self._waiting += size
        return True

    def offer_at_any_cost(self, copy: QueuedCopy) -> None:
        """Queue a message, forgetting those that have waited longest when there is no room."""
        while not self.offer(copy) and (oldest := self._held or self._queue):
            self._take(oldest)

    def send(self, now: float) -> list[mqtt5.Packet]:
        """Return what the client may get now.

        Its Receive Maximum holds QoS 1 and 2 back, in their order; QoS 0 goes past those.
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
        """Return what a client that came back has not acknowledged, in the order it was sent first."""
        again = [_packet(copy, identifier, now, again=True) for identifier, copy in self._sent.items()]
        return [*again, *map(mqtt5.PubRelPacket, self._released)]

    def forget(self, identifier: int) -> None:
        """Forget a message that arrived, or that the client would not take."""
        self._sent.pop(identifier, None)

    def on_pubrec(self, packet: mqtt5.PubRecPacket) -> mqtt5.PubRelPacket | None:
        """Release a QoS 2 message that arrived; nothing is released when the client refused it."""
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
        """Take the message that has waited longest."""
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
        """Tell whether the client takes one more QoS 1 or 2 message."""
        return len(self._sent) + len(self._released) < self.window

    def _next_id(self) -> int:
        """Return a packet identifier that is free."""
        while True:
            self._last_id = self._last_id % 0xFFFF + 1
            if self._last_id not in self._sent and self._last_id not in self._released:
                return self._last_id


def _packet(
    copy: QueuedCopy, identifier: int | None, now: float, *, again: bool = False
) -> mqtt5.PublishPacket:
    """Return PUBLISH for one client: the properties as published, the expiry less the time it waited."""
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
