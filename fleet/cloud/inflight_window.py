"""Outbound messages of one MQTT session: which to send next, which are in flight, and their outcomes."""

from __future__ import annotations

import logging

import mqtt5

from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.packets import Protocol
from fleet.cloud.publish import QueuedQos0, publish, publish_qos0
from fleet.cloud.values import PAYLOAD_LIMIT, CloudStats
from fleet.runtime.exception_barrier import call_guarded
from fleet.spool.message import DeliveryOutcome, Outgoing

logger = logging.getLogger(__name__)

WINDOW = 400
"""Bound of our unacknowledged QoS 1 messages; a lower Receive Maximum of the broker takes precedence."""
V311_WINDOW = 100
"""The same for MQTT 3.1.1, where a broker has no Receive Maximum and drops messages above its limit."""
_RESERVE = 8
"""Divisor: this part of the window is reserved for urgent messages."""
_BATCH = 16 * 1024
"""Approximate bytes of one write; other work of the loop runs between two writes."""
_QOS0_SHARE = _BATCH // 2
"""Approximate share of QoS 0 in a write, in bytes: robot states stay current during a backlog."""

_OUTCOMES = {
    int(mqtt5.PubAckReasonCode.SUCCESS): DeliveryOutcome.ACKED,
    int(mqtt5.PubAckReasonCode.NO_MATCHING_SUBSCRIBERS): DeliveryOutcome.HELD,
    int(mqtt5.PubAckReasonCode.QUOTA_EXCEEDED): DeliveryOutcome.HELD,
}
"""By reason code of PUBACK; any other code is a refusal.

Keys are ints: the codec's own codes cannot be hashed.
"""


class InflightWindow:
    """Sends the messages of one session; at its ``end``, unacknowledged ones go back to the outbox."""

    def __init__(self, outbox: OutboundQueue, stats: CloudStats, protocol: Protocol) -> None:
        self._outbox = outbox
        self._stats = stats
        self._protocol = protocol
        self._packet_limit = PAYLOAD_LIMIT
        self._window = WINDOW
        self._most_qos = 2
        self._last_id = 0
        self._inflight: dict[int, Outgoing] = {}
        self._outcomes: list[tuple[Outgoing, DeliveryOutcome]] = []
        self._timed: tuple[int, float] | None = None  # packet id and send time, for the round trip
        self._warned: set[str] = set()

    def apply_limits(self, packet: mqtt5.ConnAckPacket) -> None:
        """Apply the limits in the broker's CONNACK."""
        self._most_qos = int(packet.max_qos)
        self._packet_limit = min(packet.max_packet_size or PAYLOAD_LIMIT, PAYLOAD_LIMIT)
        self._window = min(packet.receive_max, WINDOW if self._protocol == 5 else V311_WINDOW)

    @property
    def answered(self) -> bool:
        """True when acknowledgements arrived, so that more may be sent."""
        return bool(self._outcomes)

    def busy(self) -> bool:
        """Return whether messages wait to be sent or are not acknowledged yet.

        Outcomes that the spool has not seen yet count too: they may release the next message of a topic.
        """
        return bool(self._inflight or self._outcomes) or not self._outbox.idle

    def next_id(self) -> int:
        """Return a free packet identifier."""
        while True:
            self._last_id = self._last_id % 0xFFFF + 1
            if self._last_id not in self._inflight:
                return self._last_id

    def send(self, now: float) -> bytes:
        """Return the packets of the next messages, joined; empty if nothing may be sent now."""
        sent = b""
        while not sent:
            batch = self._next_batch(now)
            qos0 = self._outbox.take_qos0(
                now, max(_QOS0_SHARE, _BATCH - sum(message.size for message in batch))
            )
            if not (batch or qos0):
                break
            sent = b"".join([self._publish(message, now) for message in batch])
            sent += b"".join([self._publish_qos0(message, now) for message in qos0])
        self._stats.inflight = len(self._inflight)
        return sent

    def end(self) -> None:
        """Return unacknowledged messages to the outbox, which goes offline."""
        self._settle()
        self._outbox.go_offline(self._inflight.values())
        self._inflight.clear()
        self._stats.inflight = 0

    def acknowledged(self, packet: mqtt5.PubAckPacket, now: float) -> None:
        """Handle PUBACK: the broker has taken or refused a QoS 1 message."""
        if self._timed and self._timed[0] == packet.packet_id:
            self._stats.rtt = now - self._timed[1]
            self._timed = None
        message = self._inflight.pop(packet.packet_id, None)
        if message is None:
            logger.warning("the broker acknowledges message %d, which is not in flight", packet.packet_id)
            return
        outcome = _OUTCOMES.get(int(packet.reason_code))
        if outcome is None:
            self._refused(message, packet.reason_code.name)
        else:
            self._record(message, outcome)

    def received(self, packet: mqtt5.PubRecPacket) -> mqtt5.PubRelPacket | None:
        """Handle PUBREC: return the PUBREL for a QoS 2 message, None if the broker refuses it.

        The message stays in flight until PUBCOMP, and is returned to the outbox like any other if the
        connection is lost before: the broker may withhold it until then. A refusal ends the exchange, also of
        a message that is not in flight (MQTT 5, 4.3.3: PUBREL answers a reason code below 0x80).
        """
        message = self._inflight.get(packet.packet_id)
        if int(packet.reason_code) >= 0x80:
            if message is None:
                logger.warning("the broker refuses message %d, which is not in flight", packet.packet_id)
            else:
                del self._inflight[packet.packet_id]
                self._refused(message, packet.reason_code.name)
            return None
        known = mqtt5.PubRelReasonCode.SUCCESS if message else mqtt5.PubRelReasonCode.PACKET_ID_NOT_FOUND
        return mqtt5.PubRelPacket(packet.packet_id, reason_code=known)

    def completed(self, packet: mqtt5.PubCompPacket, _now: float) -> None:
        """Handle PUBCOMP: the broker has a QoS 2 message, exactly once."""
        message = self._inflight.pop(packet.packet_id, None)
        if message is not None:
            self._record(message, DeliveryOutcome.ACKED)

    def _settle(self) -> None:
        """Pass the outcomes to the spool, many at once: each call takes its lock."""
        if self._outcomes:
            outcomes, self._outcomes = self._outcomes, []
            self._outbox.spool.settle(outcomes)

    def _next_batch(self, now: float) -> list[Outgoing]:
        """Take from the spool as many messages as fit in the broker's window."""
        self._settle()
        room, reserve = self._window - len(self._inflight), self._window // _RESERVE
        return self._outbox.spool.take(now, window=room, reserve=reserve, size=_BATCH)

    def _publish(self, message: Outgoing, now: float) -> bytes:
        """Return the packet of one message and mark it as in flight; empty if the broker would refuse it."""
        identifier = self.next_id()
        message.qos = min(message.qos, self._most_qos)
        try:
            data = self._checked(call_guarded(publish, message, identifier, now, self._protocol))
        except Exception as error:  # noqa: BLE001 - the other messages of its batch go on
            self._unsendable(message.topic, error)
            self._record(message, DeliveryOutcome.REFUSED)
            return b""
        self._stats.sent += 1
        self._inflight[identifier] = message
        if message.qos == 1:  # the round trip of QoS 2 takes several packets
            self._timed = self._timed or (identifier, now)
        return data

    def _publish_qos0(self, message: QueuedQos0, now: float) -> bytes:
        """Return the packet of a QoS 0 message; empty if the broker would refuse it."""
        try:
            data = self._checked(call_guarded(publish_qos0, message, now, self._protocol))
        except Exception as error:  # noqa: BLE001 - the other messages of its batch go on
            self._unsendable(message.route.topic, error)
            self._stats.outcomes[DeliveryOutcome.REFUSED] += 1
            return b""
        self._stats.sent += 1
        return data

    def _checked(self, packet: bytes) -> bytes:
        """Return a packet; raises ValueError if it is above the broker's limit."""
        if len(packet) > self._packet_limit:
            raise ValueError(f"{len(packet)} bytes; the broker takes {self._packet_limit}")
        return packet

    def _unsendable(self, topic: str, why: Exception) -> None:
        """Warn that a message cannot be sent."""
        self._warn(str(why), "a message to %s cannot be sent: %s", topic, why)

    def _refused(self, message: Outgoing, why: str) -> None:
        """Handle a message that the broker refuses."""
        self._warn(why, "the broker refuses a message to %s: %s", message.topic, why)
        self._record(message, DeliveryOutcome.REFUSED)

    def _warn(self, reason: str, text: str, *values: object) -> None:
        """Warn of the first refusal with a reason in this session; later ones are logged at debug level."""
        level = logging.DEBUG if reason in self._warned else logging.WARNING
        self._warned.add(reason)
        logger.log(level, text, *values)

    def _record(self, message: Outgoing, outcome: DeliveryOutcome) -> None:
        """Record the outcome of a message; a held message will be sent again."""
        self._stats.outcomes[outcome] += 1
        self._outcomes.append((message, outcome))
