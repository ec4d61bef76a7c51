"""One MQTT session as a pure state machine: packets and time in, packets and messages out; no I/O, no clock.

A session lives as long as its network connection (clean start, session expiry 0). At its end, unacknowledged
messages go back to the spool; the next session sends them again, in order, as duplicates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mqtt5
import msgspec

from fleet.cloud import reasons
from fleet.cloud.inflight_window import InflightWindow
from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.packets import encode
from fleet.cloud.subscriptions import Subscriptions
from fleet.cloud.values import PAYLOAD_LIMIT, CloudMessage, CloudSettings, CloudStats
from fleet.errors import CloudError

INBOUND = 100
"""Receive Maximum of the client: unacknowledged messages from the broker."""


class SessionRefused(CloudError):
    """The broker refused the session, and a quick retry would not help."""


class SessionEnded(CloudError):
    """The session cannot continue; ``code`` is the reason for our DISCONNECT, None if the broker ended it."""

    def __init__(self, message: str, code: mqtt5.DisconnectReasonCode | None = None) -> None:
        super().__init__(message)
        self.code = code


class MqttSession:
    """The client side of one connection, from CONNECT on."""

    def __init__(
        self,
        settings: CloudSettings,
        subscriptions: Mapping[str, int],
        outbox: OutboundQueue,
        stats: CloudStats,
    ) -> None:
        self.connected = False
        self.ready = False
        self.keepalive = settings.keepalive
        self.problems: list[str] = []
        self._settings = settings
        self._stats = stats
        self._window = InflightWindow(outbox, stats, settings.protocol)
        self._subscriptions = Subscriptions(subscriptions, self._window.next_id)
        self._half_received: set[int] = set()
        self._replies: list[mqtt5.Packet] = []
        self._messages: list[CloudMessage] = []
        self._handlers: dict[type, Callable[[Any, float], None]] = {
            mqtt5.ConnAckPacket: self._on_connack,
            mqtt5.SubAckPacket: self._on_suback,
            mqtt5.UnsubAckPacket: _ignore,
            mqtt5.PublishPacket: self._on_publish,
            mqtt5.PubRelPacket: self._on_pubrel,
            mqtt5.PubAckPacket: self._window.acknowledged,
            mqtt5.PubRecPacket: self._on_pubrec,
            mqtt5.PubCompPacket: self._window.completed,
            mqtt5.DisconnectPacket: self._on_disconnect,
            mqtt5.PingRespPacket: _ignore,
        }

    def connect(self) -> bytes:
        """Return the CONNECT packet."""
        chosen, will = self._settings, self._settings.will
        packet = mqtt5.ConnectPacket(
            chosen.client_id,
            username=chosen.username,
            password=None if chosen.password is None else chosen.password.encode(),
            clean_start=True,
            keep_alive=chosen.keepalive,
            receive_max=INBOUND,
            max_packet_size=PAYLOAD_LIMIT,
            will=mqtt5.Will(will.topic, payload=will.payload, qos=mqtt5.QoS(will.qos)) if will else None,
        )
        return encode(packet, chosen.protocol)

    def receive(self, packet: mqtt5.Packet, now: float) -> None:
        """Handle one packet of the broker.

        Raises SessionRefused if the broker refuses the session, SessionEnded if the connection must be
        closed.
        """
        kind = type(packet)
        handler = self._handlers.get(kind)
        # CONNACK must come first, and only once.
        if handler is None or self.connected == (kind is mqtt5.ConnAckPacket):
            raise _broken(f"the broker sent {kind.__name__} out of place")
        handler(packet, now)

    def take_replies(self) -> bytes:
        """Remove and return the pending answers to the broker, encoded."""
        replies, self._replies = self._replies, []
        return b"".join([encode(packet, self._settings.protocol) for packet in replies])

    @property
    def answers(self) -> bool:
        """True when the broker is owed an answer, or has acknowledged messages, so that more may be sent."""
        return self.owes_reply or self._window.answered

    @property
    def owes_reply(self) -> bool:
        """True when the broker is owed an answer."""
        return bool(self._replies)

    def take_messages(self) -> list[CloudMessage]:
        """Remove and return the received messages, in order."""
        messages, self._messages = self._messages, []
        return messages

    def send(self, now: float) -> bytes:
        """Return the packets of the next messages of the outbox, joined; empty if nothing may be sent now."""
        return self._window.send(now) if self.ready else b""

    def busy(self) -> bool:
        """Return whether messages wait to be sent or are not acknowledged yet."""
        return self._window.busy()

    def end(self) -> None:
        """Return unacknowledged messages to the outbox, which goes offline."""
        self.ready = False
        self._window.end()
        self._handlers.clear()  # break the reference cycle: frees the session without the garbage collector

    def _on_connack(self, packet: mqtt5.ConnAckPacket, _now: float) -> None:
        """Check that the broker accepts the connection, and subscribe to all filters."""
        if int(packet.reason_code):
            raise SessionRefused(reasons.of(packet))
        if int(packet.max_qos) == 0:
            raise SessionRefused("the broker takes only QoS 0; replies and status need QoS 1")
        self.connected = True
        self.keepalive = packet.server_keep_alive or self._settings.keepalive
        self._window.apply_limits(packet)
        self._replies += self._subscriptions.begin()
        self.ready = not self._subscriptions.open

    def resubscribe(self, subscriptions: Mapping[str, int]) -> None:
        """Replace the filters."""
        requested = list(self._subscriptions.change(subscriptions))
        self._replies += requested if self.connected else ()

    def _on_suback(self, packet: mqtt5.SubAckPacket, _now: float) -> None:
        """Record the filters that the broker refuses."""
        problems = self._subscriptions.answered(packet)
        if problems is None:
            raise _broken("the broker answers an unknown subscription")
        self.problems += problems
        self.ready = not self._subscriptions.open

    def _on_publish(self, packet: mqtt5.PublishPacket, _now: float) -> None:
        """Receive a message; one of QoS 2 is delivered once, even if it is sent again."""
        if packet.topic_alias is not None:
            self._enqueue_flawed(packet, "a topic alias that was not allowed")
            raise _broken("the broker uses a topic alias that was not allowed")
        identifier = packet.packet_id
        if identifier is None:
            self.enqueue(_message_of(packet))
        elif packet.qos == mqtt5.QoS.AT_LEAST_ONCE:
            self.enqueue(_message_of(packet))
            self._replies.append(mqtt5.PubAckPacket(identifier))
        else:
            self._on_publish_twice(packet, identifier)

    def _on_publish_twice(self, packet: mqtt5.PublishPacket, identifier: int) -> None:
        """Receive a QoS 2 message, and remember its identifier until PUBREL."""
        if identifier not in self._half_received:
            if len(self._half_received) >= INBOUND:
                self._enqueue_flawed(packet, "beyond the Receive Maximum")
                code = mqtt5.DisconnectReasonCode.RECEIVE_MAX_EXCEEDED
                raise SessionEnded("the broker has too many QoS 2 messages in flight", code)
            self._half_received.add(identifier)
            self.enqueue(_message_of(packet))
        self._replies.append(mqtt5.PubRecPacket(identifier))

    def _enqueue_flawed(self, packet: mqtt5.PublishPacket, why: str) -> None:
        """Deliver a message that breaks the protocol: it may be a stop."""
        self.enqueue(msgspec.structs.replace(_message_of(packet), flaw=why))

    def enqueue(self, message: CloudMessage) -> None:
        """Add a message to those to deliver."""
        self._stats.received += 1
        self._messages.append(message)

    def _on_pubrel(self, packet: mqtt5.PubRelPacket, _now: float) -> None:
        """Forget the identifier: the broker will not send that QoS 2 message again."""
        known = packet.packet_id in self._half_received
        self._half_received.discard(packet.packet_id)
        code = mqtt5.PubCompReasonCode.SUCCESS if known else mqtt5.PubCompReasonCode.PACKET_ID_NOT_FOUND
        self._replies.append(mqtt5.PubCompPacket(packet.packet_id, reason_code=code))

    def _on_pubrec(self, packet: mqtt5.PubRecPacket, _now: float) -> None:
        """Answer PUBREC of one of our QoS 2 messages with PUBREL."""
        release = self._window.received(packet)
        if release is not None:
            self._replies.append(release)

    def _on_disconnect(self, packet: mqtt5.DisconnectPacket, _now: float) -> None:
        """End with the broker's reason."""
        if reasons.is_permanent(int(packet.reason_code)):
            raise SessionRefused(reasons.of(packet))
        raise SessionEnded(reasons.of(packet))


def _ignore(_packet: mqtt5.Packet, _now: float) -> None:
    """Ignore a packet that only shows that the link is alive; the keepalive has recorded that."""


def _message_of(packet: mqtt5.PublishPacket) -> CloudMessage:
    """Return the message in a PUBLISH packet."""
    return CloudMessage(
        packet.topic,
        packet.payload,
        int(packet.qos),
        packet.retain,
        packet.response_topic,
        packet.correlation_data,
    )


def _broken(message: str) -> SessionEnded:
    """Return the error for a broker that violates the protocol."""
    return SessionEnded(message, mqtt5.DisconnectReasonCode.PROTOCOL_ERROR)
