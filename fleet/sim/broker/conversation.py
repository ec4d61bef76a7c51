"""MQTT conversation of one client with the broker, packet by packet; no bytes, no sockets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mqtt5

from fleet.cloud.topics import check_filter, check_topic
from fleet.sim.broker.broker_core import BrokerCore, BrokerPeer
from fleet.sim.broker.session import BrokerSession, BrokerSubscription

_GRACE = 1.5
"""Keep-alive intervals of silence after which a client counts as gone (MQTT 5, section 3.1.2.10)."""
_NOBODY = 0x10
_Answers = list[mqtt5.Packet]
_Reason = mqtt5.DisconnectReasonCode


class ClientError(Exception):
    """Protocol error of the client; ``reason`` is sent to it before the connection ends."""

    def __init__(self, message: str, reason: mqtt5.DisconnectReasonCode) -> None:
        super().__init__(message)
        self.reason = reason


class Conversation:
    """State of one client's connection, from CONNECT to its end.

    ``session`` is None before CONNECT and after the end; ``over``: close the connection after everything is
    written. ``patience`` is the permitted silence of the client in seconds; 0: unlimited.
    """

    def __init__(self, hub: BrokerCore, peer: BrokerPeer) -> None:
        self.session: BrokerSession | None = None
        self.over = False
        self.patience = hub.limits.connect_timeout
        self.packet_limit = hub.limits.packet
        self._hub = hub
        self._peer = peer
        self._protocol: int | None = None
        self._will: mqtt5.Will | None = None
        self._handlers: dict[type, Callable[[Any, BrokerSession], _Answers]] = {
            mqtt5.PublishPacket: self._on_publish,
            mqtt5.PubAckPacket: self._on_puback,
            mqtt5.PubRecPacket: self._on_pubrec,
            mqtt5.PubRelPacket: self._on_pubrel,
            mqtt5.PubCompPacket: self._on_pubcomp,
            mqtt5.SubscribePacket: self._on_subscribe,
            mqtt5.UnsubscribePacket: self._on_unsubscribe,
            mqtt5.PingReqPacket: lambda _packet, _session: [mqtt5.PingRespPacket()],
            mqtt5.DisconnectPacket: self._on_disconnect,
        }

    def receive(self, packet: mqtt5.Packet, protocol: int | None) -> _Answers:
        """Handle one packet and return the answers; raises ClientError if it ends the connection."""
        if isinstance(packet, mqtt5.ConnectPacket):
            self._protocol = protocol
            return self._on_connect(packet)
        handler = self._handlers.get(type(packet))
        if handler is None or self.session is None:
            raise ClientError(f"{type(packet).__name__} out of place", _Reason.PROTOCOL_ERROR)
        return handler(packet, self.session)

    def end(self, reason: mqtt5.DisconnectReasonCode) -> _Answers:
        """End the connection by the broker; return the DISCONNECT for a connected MQTT 5 client."""
        notified = self.session is not None and self._protocol == 5
        self.leave()
        self.over = True
        return [mqtt5.DisconnectPacket(reason_code=reason)] if notified else []

    def leave(self) -> None:
        """Leave the hub, once; the will is published unless the client sent DISCONNECT."""
        session, self.session = self.session, None
        will, self._will = self._will, None
        if session:
            self._hub.leave(session, will)

    def _on_connect(self, packet: mqtt5.ConnectPacket) -> _Answers:
        """Accept the client, or answer with the reason for the refusal."""
        if self.session:
            raise ClientError("a second CONNECT", _Reason.PROTOCOL_ERROR)
        if refusal := self._refusal(packet):
            self.over = True
            return [mqtt5.ConnAckPacket(reason_code=refusal)]
        session, present = self._hub.admit(packet, self._peer)
        self.session, self._will = session, packet.will
        self.patience = packet.keep_alive * _GRACE
        self.packet_limit = packet.max_packet_size or self.packet_limit
        answer = mqtt5.ConnAckPacket(
            session_present=present,
            assigned_client_id=None if packet.client_id else session.client_id,
            receive_max=self._hub.limits.receive,
            max_packet_size=self._hub.limits.packet,
            shared_subscription_available=False,
        )
        return [answer, *session.resume(self._hub.clock.monotonic())]

    def _refusal(self, packet: mqtt5.ConnectPacket) -> mqtt5.ConnAckReasonCode | None:
        """Return the reason to refuse the client, None if it is accepted."""
        if packet.will and _is_wrong(check_topic, packet.will.topic):
            return mqtt5.ConnAckReasonCode.TOPIC_NAME_INVALID
        if self._protocol == 311 and not packet.client_id and not packet.clean_start:
            return mqtt5.ConnAckReasonCode.CLIENT_ID_NOT_VALID
        return self._hub.refusal(packet)

    def _on_publish(self, packet: mqtt5.PublishPacket, session: BrokerSession) -> _Answers:
        """Route a message and acknowledge it."""
        if packet.topic_alias is not None:
            raise ClientError("a topic alias", _Reason.TOPIC_ALIAS_INVALID)
        identifier = packet.packet_id
        if identifier is not None and packet.qos == mqtt5.QoS.EXACTLY_ONCE:
            return self._on_publish_twice(packet, identifier, session)
        heard = self._hub.publish(packet, session)
        if identifier is None or self._hub.faults.no_puback:
            return []
        code = mqtt5.PubAckReasonCode(0 if heard else _NOBODY)
        return [mqtt5.PubAckPacket(identifier, reason_code=code)]

    def _on_publish_twice(
        self, packet: mqtt5.PublishPacket, identifier: int, session: BrokerSession
    ) -> _Answers:
        """Handle a QoS 2 message; it is routed once, however often it is sent."""
        heard = True
        if identifier not in session.received:
            if len(session.received) >= self._hub.limits.receive:
                raise ClientError("too many QoS 2 messages under way", _Reason.RECEIVE_MAX_EXCEEDED)
            session.received.add(identifier)
            heard = self._hub.publish(packet, session)
        code = mqtt5.PubRecReasonCode(0 if heard else _NOBODY)
        return [mqtt5.PubRecPacket(identifier, reason_code=code)]

    def _on_puback(self, packet: mqtt5.PubAckPacket, session: BrokerSession) -> _Answers:
        """Forget a QoS 1 message that the client has acknowledged."""
        session.forget(packet.packet_id)
        return []

    def _on_pubrec(self, packet: mqtt5.PubRecPacket, session: BrokerSession) -> _Answers:
        """Release a QoS 2 message that the client has received."""
        release = session.on_pubrec(packet)
        return [release] if release else []

    def _on_pubrel(self, packet: mqtt5.PubRelPacket, session: BrokerSession) -> _Answers:
        """Complete a QoS 2 message of the client."""
        code = mqtt5.PubCompReasonCode(0 if packet.packet_id in session.received else 0x92)
        session.received.discard(packet.packet_id)
        return [mqtt5.PubCompPacket(packet.packet_id, reason_code=code)]

    def _on_pubcomp(self, packet: mqtt5.PubCompPacket, session: BrokerSession) -> _Answers:
        """Forget a QoS 2 message that is complete."""
        session.on_pubcomp(packet.packet_id)
        return []

    def _on_subscribe(self, packet: mqtt5.SubscribePacket, session: BrokerSession) -> _Answers:
        """Add subscriptions; shared ones, and those beyond the limit, are refused."""
        codes = [
            self._subscribe(BrokerSubscription(each, packet.subscription_id), session)
            for each in packet.topic_filters
        ]
        return [mqtt5.SubAckPacket(packet.packet_id, codes)]

    def _subscribe(self, subscription: BrokerSubscription, session: BrokerSession) -> mqtt5.SubAckReasonCode:
        """Add one subscription and return the answer."""
        pattern = subscription.options.pattern
        if _is_wrong(check_filter, pattern):
            raise ClientError(f"the filter {pattern!r}", _Reason.TOPIC_FILTER_INVALID)
        if pattern.startswith("$share/"):
            return mqtt5.SubAckReasonCode.SHARED_SUBSCRIPTIONS_NOT_SUPPORTED
        full = len(session.subscriptions) >= self._hub.limits.subscriptions
        if full and pattern not in session.subscriptions:
            return mqtt5.SubAckReasonCode.QUOTA_EXCEEDED
        self._hub.subscribe(session, subscription)
        return mqtt5.SubAckReasonCode(int(subscription.options.max_qos))

    def _on_unsubscribe(self, packet: mqtt5.UnsubscribePacket, session: BrokerSession) -> _Answers:
        """Remove subscriptions."""
        found = [self._hub.unsubscribe(session, pattern) for pattern in packet.patterns]
        codes = [mqtt5.UnsubAckReasonCode(0 if one else 0x11) for one in found]
        return [mqtt5.UnsubAckPacket(packet.packet_id, codes)]

    def _on_disconnect(self, packet: mqtt5.DisconnectPacket, session: BrokerSession) -> _Answers:
        """Handle DISCONNECT; the will is not published unless the client requests it."""
        if packet.session_expiry_interval and not session.expiry:
            raise ClientError("a session that was to end is to last", _Reason.PROTOCOL_ERROR)
        if packet.session_expiry_interval is not None:
            session.expiry = packet.session_expiry_interval
        if packet.reason_code == _Reason.NORMAL_DISCONNECTION:
            self._will = None
        self.leave()
        self.over = True
        return []


def _is_wrong(check: Callable[[str], str], text: str) -> bool:
    """Return True for a topic or filter that MQTT forbids."""
    try:
        check(text)
    except ValueError:
        return True
    return False
