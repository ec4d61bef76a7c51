"""Our messages to the broker: which may be sent next, which it has not acknowledged, what became of each."""

from __future__ import annotations

import logging

import mqtt5

from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.packets import Protocol
from fleet.cloud.publish import QueuedQos0, publish, publish_light
from fleet.cloud.values import PAYLOAD_LIMIT, CloudStats
from fleet.spool.message import Outcome, Outgoing

logger = logging.getLogger(__name__)

WINDOW = 400
"""Most QoS 1 messages of ours under way at once, where the broker does not want less (Receive Maximum)."""
UNTOLD_WINDOW = 100
"""The same over MQTT 3.1.1, where a broker cannot say what it can take and drops what is too much."""
_RESERVE = 8
"""Part (one in so many) of the window that only urgent messages may use."""
_BATCH = 16 * 1024
"""Bytes that one write joins, at most and about: between two writes whatever else came has its turn."""
_LIGHT = _BATCH // 2
"""Bytes of it, about, that messages of QoS 0 get: a backlog takes no robot's state from sight."""

_OUTCOMES = {
    int(mqtt5.PubAckReasonCode.SUCCESS): Outcome.ACKED,
    int(mqtt5.PubAckReasonCode.NO_MATCHING_SUBSCRIBERS): Outcome.HELD,
    int(mqtt5.PubAckReasonCode.QUOTA_EXCEEDED): Outcome.HELD,
}
"""By reason code of PUBACK; every other code is a refusal. The codec's own codes cannot be hashed."""


class InflightWindow:
    """What one session sends. What was sent and not acknowledged goes back to the outbox at its ``end``."""

    def __init__(self, outbox: OutboundQueue, stats: CloudStats, protocol: Protocol) -> None:
        self._outbox = outbox
        self._stats = stats
        self._protocol = protocol
        self._packet_limit = PAYLOAD_LIMIT
        self._window = WINDOW
        self._most_qos = 2
        self._last_id = 0
        self._inflight: dict[int, Outgoing] = {}
        self._answers: list[tuple[Outgoing, Outcome]] = []
        self._timed: tuple[int, float] | None = None  # whose round trip is measured, and its begin
        self._told: set[str] = set()

    def agree(self, packet: mqtt5.ConnAckPacket) -> None:
        """Take over what the broker says that it takes."""
        self._most_qos = int(packet.max_qos)
        self._packet_limit = min(packet.max_packet_size or PAYLOAD_LIMIT, PAYLOAD_LIMIT)
        self._window = min(packet.receive_max, WINDOW if self._protocol == 5 else UNTOLD_WINDOW)

    @property
    def answered(self) -> bool:
        """True when acknowledgements came, so that more may be sent."""
        return bool(self._answers)

    def busy(self) -> bool:
        """Tell whether messages could be sent or are not acknowledged yet.

        An acknowledgement that the spool has not seen yet may let the next message of its topic go.
        """
        return bool(self._inflight or self._answers) or not self._outbox.idle

    def next_id(self) -> int:
        """Return a packet identifier that is free."""
        while True:
            self._last_id = self._last_id % 0xFFFF + 1
            if self._last_id not in self._inflight:
                return self._last_id

    def send(self, now: float) -> bytes:
        """Return the bytes of the next messages, joined; empty when nothing may be sent now."""
        sent = b""
        while not sent:
            batch = self._next_batch(now)
            light = self._outbox.take_light(now, max(_LIGHT, _BATCH - sum(message.size for message in batch)))
            if not (batch or light):
                break
            sent = b"".join([self._publish(message, now) for message in batch])
            sent += b"".join([self._publish_light(message, now) for message in light])
        self._stats.inflight = len(self._inflight)
        return sent

    def end(self) -> None:
        """Give what was not acknowledged back to the outbox, which is offline from now on."""
        self._settle()
        self._outbox.go_offline(self._inflight.values())
        self._inflight.clear()
        self._stats.inflight = 0

    def acknowledged(self, packet: mqtt5.PubAckPacket, now: float) -> None:
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

    def received(self, packet: mqtt5.PubRecPacket) -> mqtt5.PubRelPacket | None:
        """Return what releases a QoS 2 message that the broker has, None when it refuses it.

        It stays in the window until it is completed, and is given back like any other when the connection
        falls before: a broker may hold it until then.
        """
        message = self._inflight.get(packet.packet_id)
        if int(packet.reason_code) >= 0x80 and message is not None:
            del self._inflight[packet.packet_id]
            self._refused(message, packet.reason_code.name)
            return None
        known = mqtt5.PubRelReasonCode.SUCCESS if message else mqtt5.PubRelReasonCode.PACKET_ID_NOT_FOUND
        return mqtt5.PubRelPacket(packet.packet_id, reason_code=known)

    def completed(self, packet: mqtt5.PubCompPacket, _now: float) -> None:
        """Note that the broker has a QoS 2 message, once."""
        message = self._inflight.pop(packet.packet_id, None)
        if message is not None:
            self._done(message, Outcome.ACKED)

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

    def _publish(self, message: Outgoing, now: float) -> bytes:
        """Return the bytes of one message and note what is awaited; empty when the broker would refuse it."""
        identifier = self.next_id()
        message.qos = min(message.qos, self._most_qos)
        try:
            data = publish(message, identifier, now, self._protocol)
            if len(data) > self._packet_limit:
                raise self._too_large(data)
        except (ValueError, TypeError) as error:
            self._cannot(message.topic, error)
            self._done(message, Outcome.REFUSED)
            return b""
        self._stats.sent += 1
        self._inflight[identifier] = message
        if message.qos == 1:  # one of QoS 2 is not acknowledged in one step
            self._timed = self._timed or (identifier, now)
        return data

    def _publish_light(self, message: QueuedQos0, now: float) -> bytes:
        """Return the bytes of one message of QoS 0; empty when the broker would refuse it."""
        try:
            data = publish_light(message, now, self._protocol)
            if len(data) > self._packet_limit:
                raise self._too_large(data)
        except (ValueError, TypeError) as error:
            self._cannot(message.where.topic, error)
            self._stats.outcomes[Outcome.REFUSED] += 1
            return b""
        self._stats.sent += 1
        return data

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
