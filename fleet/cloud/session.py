"""One MQTT session as a pure machine: packets and time in, packets and messages out; no I/O, no clock.

A session lives as long as its network connection (clean start, session expiry 0). What was sent and not
acknowledged goes back to the spool when it ends; the next session sends it again, in order, as duplicates.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any

import mqtt5

from fleet.cloud import reasons
from fleet.cloud.outbox import Outbox
from fleet.cloud.packets import encode
from fleet.cloud.publish import publish
from fleet.cloud.values import PAYLOAD_LIMIT, CloudSettings, CloudStats, Message
from fleet.errors import CloudError
from fleet.spool.message import Outcome, Outgoing

logger = logging.getLogger(__name__)

WINDOW = 400
"""Most QoS 1 messages of ours under way at once, where the broker does not want less (Receive Maximum)."""
UNTOLD_WINDOW = 100
"""The same over MQTT 3.1.1, where a broker cannot say what it can take and drops what is too much."""
INBOUND = 100
"""Most messages that the broker may have under way to us."""
_RESERVE = 8
"""Part (one in so many) of the window that only urgent messages may use."""
_FILTERS = 64
"""Filters in one SUBSCRIBE."""
_BATCH = 8 * 1024
"""Bytes that one write joins, at most and about: a third of a millisecond's work."""

_OUTCOMES = {
    int(mqtt5.PubAckReasonCode.SUCCESS): Outcome.ACKED,
    int(mqtt5.PubAckReasonCode.NO_MATCHING_SUBSCRIBERS): Outcome.HELD,
    int(mqtt5.PubAckReasonCode.QUOTA_EXCEEDED): Outcome.HELD,
}
"""By reason code of PUBACK; every other code is a refusal. The codec's own codes cannot be hashed."""


class SessionRefused(CloudError):
    """The broker refused the session, and asking again soon would not help."""


class SessionEnded(CloudError):
    """The session cannot go on; ``code`` is the reason to give the broker, None when it ended it."""

    def __init__(self, message: str, code: mqtt5.DisconnectReasonCode | None = None) -> None:
        super().__init__(message)
        self.code = code


class Session:
    """The client's side of one connection, from CONNECT on."""

    def __init__(
        self, settings: CloudSettings, subscriptions: Mapping[str, int], outbox: Outbox, stats: CloudStats
    ) -> None:
        self.connected = False
        self.ready = False
        self.keepalive = settings.keepalive
        self.problems: list[str] = []
        self._settings = settings
        self._subscriptions = subscriptions
        self._outbox = outbox
        self._stats = stats
        self._packet_limit = PAYLOAD_LIMIT
        self._window = WINDOW
        self._most_qos = 2
        self._last_id = 0
        self._inflight: dict[int, Outgoing] = {}
        self._subscribing: dict[int, list[str]] = {}
        self._half_received: set[int] = set()
        self._replies: list[mqtt5.Packet] = []
        self._messages: list[Message] = []
        self._answers: list[tuple[Outgoing, Outcome]] = []
        self._timed: tuple[int, float] | None = None
        self._told: set[str] = set()
        self._handlers: dict[type, Callable[[Any, float], None]] = {
            mqtt5.ConnAckPacket: self._on_connack,
            mqtt5.SubAckPacket: self._on_suback,
            mqtt5.PublishPacket: self._on_publish,
            mqtt5.PubRelPacket: self._on_pubrel,
            mqtt5.PubAckPacket: self._on_puback,
            mqtt5.PubRecPacket: self._on_pubrec,
            mqtt5.PubCompPacket: self._on_pubcomp,
            mqtt5.DisconnectPacket: self._on_disconnect,
            mqtt5.PingRespPacket: self._on_pong,
        }

    def connect(self) -> bytes:
        """Return CONNECT."""
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
        return self._encode(packet)

    def receive(self, packet: mqtt5.Packet, now: float) -> None:
        """Take one packet of the broker.

        Raises SessionRefused when the broker says no and SessionEnded when the connection must be given up.
        """
        handler = self._handlers.get(type(packet))
        # CONNACK comes first and never again.
        if handler is None or self.connected == isinstance(packet, mqtt5.ConnAckPacket):
            raise _broken(f"the broker sent {type(packet).__name__} out of place")
        handler(packet, now)

    def take_replies(self) -> bytes:
        """Return the bytes that answer what was received, and forget them."""
        replies, self._replies = self._replies, []
        return b"".join(map(self._encode, replies))

    @property
    def answers(self) -> bool:
        """True when what was received is to be answered, or lets more be sent."""
        return bool(self._replies or self._answers)

    def take_messages(self) -> list[Message]:
        """Return the messages that were received, in order, and forget them."""
        messages, self._messages = self._messages, []
        return messages

    def send(self, now: float) -> bytes:
        """Return the bytes of the next messages of the outbox, joined; empty when nothing may be sent now."""
        if not self.ready:
            return b""
        sent = b""
        while not sent:
            batch = self._next_batch(now)
            light = self._outbox.take_light(now, _BATCH - sum(message.size for message in batch))
            if not (batch or light):
                break
            sent = b"".join([self._publish(message, now) for message in batch])
            sent += b"".join([packet for where, packet in light if self._fits(where.topic, packet)])
        self._stats.inflight = len(self._inflight)
        return sent

    def busy(self) -> bool:
        """Tell whether messages could be sent or are not acknowledged yet."""
        return bool(self._inflight) or not self._outbox.idle

    def end(self) -> None:
        """Give what was not acknowledged back to the outbox, which is offline from now on."""
        self.ready = False
        self._settle()
        self._outbox.go_offline(self._inflight.values())
        self._inflight.clear()
        self._stats.inflight = 0

    def _settle(self) -> None:
        """Tell the spool what became of messages, many at once: each time costs it a lock."""
        if self._answers:
            answers, self._answers = self._answers, []
            self._outbox.spool.settle(answers)

    def _next_batch(self, now: float) -> list[Outgoing]:
        """Take from the spool what the broker's window has room for."""
        self._settle()
        room, reserve = self._window - len(self._inflight), self._window // _RESERVE
        return self._outbox.spool.take(now, window=room, reserve=reserve, size=_BATCH)

    def _encode(self, packet: mqtt5.Packet) -> bytes:
        """Return the packet's bytes in the protocol that was chosen."""
        return encode(packet, self._settings.protocol)

    def _next_id(self) -> int:
        """Return a packet identifier that is free."""
        while True:
            self._last_id = self._last_id % 0xFFFF + 1
            if self._last_id not in self._inflight and self._last_id not in self._subscribing:
                return self._last_id

    def _publish(self, message: Outgoing, now: float) -> bytes:
        """Return the bytes of one message and note what is awaited; empty when the broker would refuse it."""
        identifier = self._next_id()
        message.qos = min(message.qos, self._most_qos)
        try:
            data = publish(message, identifier, now, self._settings.protocol)
            if len(data) > self._packet_limit:
                raise self._too_large(data)
        except (ValueError, TypeError) as error:
            self._cannot(message.topic, error)
            self._done(message, Outcome.REFUSED)
            return b""
        self._stats.sent += 1
        self._inflight[identifier] = message
        self._timed = self._timed or (identifier, now)
        return data

    def _fits(self, topic: str, packet: bytes) -> bool:
        """Tell whether the broker takes a packet of QoS 0, which is counted."""
        if len(packet) <= self._packet_limit:
            self._stats.sent += 1
            return True
        self._cannot(topic, self._too_large(packet))
        self._stats.outcomes[Outcome.REFUSED] += 1
        return False

    def _too_large(self, packet: bytes) -> ValueError:
        """Return the error for a packet that is larger than the broker takes."""
        return ValueError(f"{len(packet)} bytes; the broker takes {self._packet_limit}")

    def _cannot(self, topic: str, why: Exception) -> None:
        """Tell that a message cannot be sent."""
        self._tell(str(why), "a message to %s cannot be sent: %s", topic, why)

    def _refused(self, message: Outgoing, why: str) -> None:
        """Note that the broker will not have a message."""
        self._tell(why, "the broker refuses a message to %s: %s", message.topic, why)
        self._done(message, Outcome.REFUSED)

    def _tell(self, reason: str, text: str, *values: object) -> None:
        """Warn of a refusal, the first of each reason in this session; all are counted."""
        level = logging.DEBUG if reason in self._told else logging.WARNING
        self._told.add(reason)
        logger.log(level, text, *values)

    def _done(self, message: Outgoing, outcome: Outcome) -> None:
        """Note what became of a message; one that is held is sent again."""
        self._stats.outcomes[outcome] += 1
        self._answers.append((message, outcome))

    def _on_connack(self, packet: mqtt5.ConnAckPacket, _now: float) -> None:
        """Note whether the broker lets us in, and subscribe to everything."""
        if int(packet.reason_code):
            raise SessionRefused(reasons.of(packet))
        if int(packet.max_qos) == 0:
            raise SessionRefused("the broker takes only QoS 0; replies and status need QoS 1")
        self.connected = True
        self._most_qos = int(packet.max_qos)
        self.keepalive = packet.server_keep_alive or self._settings.keepalive
        self._packet_limit = min(packet.max_packet_size or PAYLOAD_LIMIT, PAYLOAD_LIMIT)
        most = WINDOW if self._settings.protocol == 5 else UNTOLD_WINDOW
        self._window = min(packet.receive_max, most)
        wanted = list(self._subscriptions.items())
        for start in range(0, len(wanted), _FILTERS):
            self._subscribe(wanted[start : start + _FILTERS])
        self.ready = not wanted

    def _subscribe(self, wanted: list[tuple[str, int]]) -> None:
        """Ask for some filters; what we publish ourselves must not come back as if somebody asked for it."""
        identifier = self._next_id()
        filters = [
            mqtt5.TopicFilter(pattern, max_qos=mqtt5.QoS(qos), no_local=True, retain_as_published=False)
            for pattern, qos in wanted
        ]
        self._subscribing[identifier] = [pattern for pattern, _ in wanted]
        self._replies.append(mqtt5.SubscribePacket(identifier, filters))

    def _on_suback(self, packet: mqtt5.SubAckPacket, _now: float) -> None:
        """Note which filters the broker took."""
        patterns = self._subscribing.pop(packet.packet_id, [])
        if len(patterns) != len(packet.reason_codes):
            raise _broken("the broker answers a subscription that was not asked for")
        for pattern, code in zip(patterns, packet.reason_codes, strict=True):
            if int(code) >= 0x80:
                self.problems.append(f"the broker refuses the subscription {pattern} ({code.name})")
        self.ready = not self._subscribing

    def _on_publish(self, packet: mqtt5.PublishPacket, _now: float) -> None:
        """Take a message; one of QoS 2 is handed out once, however often it is sent."""
        if packet.topic_alias is not None:
            raise _broken("the broker uses a topic alias that was not allowed")
        identifier = packet.packet_id
        if identifier is None:
            self._take(packet)
        elif packet.qos == mqtt5.QoS.AT_LEAST_ONCE:
            self._take(packet)
            self._replies.append(mqtt5.PubAckPacket(identifier))
        else:
            self._on_publish_twice(packet, identifier)

    def _on_publish_twice(self, packet: mqtt5.PublishPacket, identifier: int) -> None:
        """Take a message of QoS 2, remembering its identifier until the broker releases it."""
        if identifier not in self._half_received:
            if len(self._half_received) >= INBOUND:
                code = mqtt5.DisconnectReasonCode.RECEIVE_MAX_EXCEEDED
                raise SessionEnded("the broker has too many QoS 2 messages under way", code)
            self._half_received.add(identifier)
            self._take(packet)
        self._replies.append(mqtt5.PubRecPacket(identifier))

    def _take(self, packet: mqtt5.PublishPacket) -> None:
        """Add a message to those that are handed out."""
        self._stats.received += 1
        self._messages.append(
            Message(
                packet.topic,
                packet.payload,
                int(packet.qos),
                packet.retain,
                packet.response_topic,
                packet.correlation_data,
            )
        )

    def _on_pubrel(self, packet: mqtt5.PubRelPacket, _now: float) -> None:
        """Forget the identifier: the broker will not send that QoS 2 message again."""
        known = packet.packet_id in self._half_received
        self._half_received.discard(packet.packet_id)
        code = mqtt5.PubCompReasonCode.SUCCESS if known else mqtt5.PubCompReasonCode.PACKET_ID_NOT_FOUND
        self._replies.append(mqtt5.PubCompPacket(packet.packet_id, reason_code=code))

    def _on_puback(self, packet: mqtt5.PubAckPacket, now: float) -> None:
        """Note that the broker has one of our messages, or refuses it."""
        if self._timed and self._timed[0] == packet.packet_id:
            self._stats.rtt = now - self._timed[1]
            self._timed = None
        message = self._inflight.pop(packet.packet_id, None)
        if message is None:
            logger.warning("the broker acknowledges message %d, which is not under way", packet.packet_id)
            return
        outcome = _OUTCOMES.get(int(packet.reason_code))
        if outcome is None:
            self._refused(message, packet.reason_code.name)
        else:
            self._done(message, outcome)

    def _on_pubrec(self, packet: mqtt5.PubRecPacket, _now: float) -> None:
        """Release a QoS 2 message that the broker has; it stays in the window until that is done.

        It is given back like any other when the connection falls before: a broker may hold it until then.
        """
        message = self._inflight.get(packet.packet_id)
        if int(packet.reason_code) >= 0x80 and message is not None:
            del self._inflight[packet.packet_id]
            self._refused(message, packet.reason_code.name)
            return
        known = mqtt5.PubRelReasonCode.SUCCESS if message else mqtt5.PubRelReasonCode.PACKET_ID_NOT_FOUND
        self._replies.append(mqtt5.PubRelPacket(packet.packet_id, reason_code=known))

    def _on_pubcomp(self, packet: mqtt5.PubCompPacket, _now: float) -> None:
        """Note that the broker has a QoS 2 message, once."""
        message = self._inflight.pop(packet.packet_id, None)
        if message is not None:
            self._done(message, Outcome.ACKED)

    def _on_disconnect(self, packet: mqtt5.DisconnectPacket, _now: float) -> None:
        """End with the broker's reason."""
        if reasons.lasting(int(packet.reason_code)):
            raise SessionRefused(reasons.of(packet))
        raise SessionEnded(reasons.of(packet))

    def _on_pong(self, _packet: mqtt5.PingRespPacket, _now: float) -> None:
        """Do nothing: the keepalive watch has already noted that the link is alive."""


def _broken(message: str) -> SessionEnded:
    """Return the error for a broker that breaks the protocol."""
    return SessionEnded(message, mqtt5.DisconnectReasonCode.PROTOCOL_ERROR)
