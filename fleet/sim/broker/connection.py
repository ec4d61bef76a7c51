"""One client's network connection at the broker: packets in, packets out, time-outs."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Any

import mqtt5

from fleet.cloud.packets import Decoder, PacketTooLarge, encode
from fleet.cloud.topics import check_filter, check_topic
from fleet.errors import WireError
from fleet.sim.broker.hub import Hub
from fleet.sim.broker.session import Session, Subscription

logger = logging.getLogger(__name__)

_GRACE = 1.5
"""Keepalives of silence after which a client counts as gone (MQTT 5, section 3.1.2.10)."""
_Reason = mqtt5.DisconnectReasonCode


class ClientError(Exception):
    """The client broke the protocol; ``reason`` is what it is told before the connection ends."""

    def __init__(self, message: str, reason: mqtt5.DisconnectReasonCode) -> None:
        super().__init__(message)
        self.reason = reason


class Connection(asyncio.Protocol):
    """Serves one client; whatever it sends can end only its own connection."""

    def __init__(self, hub: Hub, everyone: set[Connection]) -> None:
        self._hub = hub
        self._everyone = everyone
        self._decoder = Decoder(None, hub.limits.packet)
        self._transport: asyncio.Transport | None = None
        self._session: Session | None = None
        self._will: mqtt5.Will | None = None
        self._packet_limit = hub.limits.packet
        self._paused = False
        self._closing = False
        self._forgotten = False
        self._asleep = False
        self._unread = b""
        self._patience = hub.limits.connect_timeout
        self._heard = hub.clock.monotonic()
        self._handlers: dict[type, Callable[[Any, Session], None]] = {
            mqtt5.PublishPacket: self._on_publish,
            mqtt5.PubAckPacket: lambda packet, session: session.on_puback(packet.packet_id),
            mqtt5.PubRecPacket: self._on_pubrec,
            mqtt5.PubRelPacket: self._on_pubrel,
            mqtt5.PubCompPacket: lambda packet, session: session.on_pubcomp(packet.packet_id),
            mqtt5.SubscribePacket: self._on_subscribe,
            mqtt5.UnsubscribePacket: self._on_unsubscribe,
            mqtt5.PingReqPacket: lambda _packet, _session: self._write([mqtt5.PingRespPacket()]),
            mqtt5.DisconnectPacket: self._on_disconnect,
        }

    @property
    def silent(self) -> bool:
        """Tell whether nothing is read or written, because of a fault."""
        return self._forgotten or self._asleep or self._hub.faults.freeze

    @property
    def client_id(self) -> str:
        """Return the client's name, empty before CONNECT."""
        return self._session.client_id if self._session else ""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to listen."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._everyone.add(self)

    def data_received(self, data: bytes) -> None:
        """Take what arrived; while the broker is frozen it is kept for later."""
        if self.silent:
            self._sleep(data)
            return
        self._heard = self._hub.clock.monotonic()
        try:
            self._receive_all(data)
        except PacketTooLarge as error:
            self._end(str(error), _Reason.PACKET_TOO_LARGE)
        except WireError as error:
            self._end(str(error), _Reason.MALFORMED_PACKET)
        except ClientError as error:
            self._end(str(error), error.reason)
        self.flush()

    def flush(self) -> None:
        """Write what waits in the client's session, as far as the socket and the client take it."""
        if self._session and not (self._paused or self.silent):
            self._write(self._session.send(self._hub.clock.monotonic()))

    def expel(self, reason: mqtt5.DisconnectReasonCode) -> None:
        """End the connection for a reason that is not the client's bytes."""
        self._end("expelled", reason)

    def watch(self) -> None:
        """Go on after a freeze; end the connection when the client has been silent for too long."""
        if self._hub.faults.freeze:
            self._sleep(b"")
        elif self._asleep:
            self._wake()
        elif self._patience and self._hub.clock.monotonic() - self._heard > self._patience:
            self._lose_patience()

    def forget(self) -> None:
        """Fall silent and forget the client while the socket stays open, as after a power cut."""
        self._forgotten = True
        self._patience = 0
        self._leave()

    def drop(self) -> None:
        """Cut the connection without a word."""
        if self._transport:
            self._transport.abort()

    def pause_writing(self) -> None:
        """Let the session keep what the socket does not take."""
        self._paused = True

    def resume_writing(self) -> None:
        """Go on where the socket stopped."""
        self._paused = False
        self.flush()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio passes it
        """Note that the client is gone; its will is published unless it said goodbye."""
        self._everyone.discard(self)
        self._leave()

    def _sleep(self, data: bytes) -> None:
        """Read no more for now, and keep what was read; a client that is forgotten is not listened to."""
        if self._forgotten:
            return
        self._asleep = True
        self._unread += data
        if self._transport:
            self._transport.pause_reading()

    def _wake(self) -> None:
        """Go on after a freeze."""
        self._asleep = False
        unread, self._unread = self._unread, b""
        if self._transport:
            self._transport.resume_reading()
        self.data_received(unread)

    def _lose_patience(self) -> None:
        """Tell a silent client to go; cut it off when it was told already."""
        if self._closing:
            self.drop()
        else:
            self._end("silent for too long", _Reason.KEEP_ALIVE_TIMEOUT)

    def _receive_all(self, data: bytes) -> None:
        """Take the packets that the bytes complete, up to the one that ends the connection."""
        for packet in self._decoder.feed(data):
            if self._closing:
                return
            self._receive(packet)

    def _receive(self, packet: mqtt5.Packet) -> None:
        """Take one packet."""
        if isinstance(packet, mqtt5.ConnectPacket):
            self._on_connect(packet)
            return
        handler = self._handlers.get(type(packet))
        if handler is None or self._session is None:
            raise ClientError(f"{type(packet).__name__} out of place", _Reason.PROTOCOL_ERROR)
        handler(packet, self._session)

    def _on_connect(self, packet: mqtt5.ConnectPacket) -> None:
        """Let the client in, or say why not."""
        if self._session:
            raise ClientError("a second CONNECT", _Reason.PROTOCOL_ERROR)
        if refusal := self._refusal(packet):
            self._write([mqtt5.ConnAckPacket(reason_code=refusal)])
            self._close()
            return
        session, present = self._hub.admit(packet, self)
        self._session, self._will = session, packet.will
        self._patience = packet.keep_alive * _GRACE
        self._packet_limit = packet.max_packet_size or self._packet_limit
        answer = mqtt5.ConnAckPacket(
            session_present=present,
            assigned_client_id=None if packet.client_id else session.client_id,
            receive_max=self._hub.limits.receive,
            max_packet_size=self._hub.limits.packet,
            shared_subscription_available=False,
        )
        self._write([answer, *session.resume(self._hub.clock.monotonic())])

    def _refusal(self, packet: mqtt5.ConnectPacket) -> mqtt5.ConnAckReasonCode | None:
        """Return why the client is not let in, None when it is."""
        if packet.will and _is_wrong(check_topic, packet.will.topic):
            return mqtt5.ConnAckReasonCode.TOPIC_NAME_INVALID
        if self._decoder.protocol == 311 and not packet.client_id and not packet.clean_start:
            return mqtt5.ConnAckReasonCode.CLIENT_ID_NOT_VALID
        return self._hub.refusal(packet)

    def _on_publish(self, packet: mqtt5.PublishPacket, session: Session) -> None:
        """Route a message and acknowledge it; one of QoS 2 is routed once, however often it is sent."""
        if packet.topic_alias is not None:
            raise ClientError("a topic alias", _Reason.TOPIC_ALIAS_INVALID)
        identifier = packet.packet_id
        if identifier is None:
            self._hub.publish(packet, session)
        elif packet.qos == mqtt5.QoS.AT_LEAST_ONCE:
            heard = self._hub.publish(packet, session)
            if not self._hub.faults.no_puback:
                code = mqtt5.PubAckReasonCode(0 if heard else 0x10)
                self._write([mqtt5.PubAckPacket(identifier, reason_code=code)])
        else:
            self._on_publish_twice(packet, identifier, session)

    def _on_publish_twice(self, packet: mqtt5.PublishPacket, identifier: int, session: Session) -> None:
        """Take a message of QoS 2."""
        heard = True
        if identifier not in session.received:
            if len(session.received) >= self._hub.limits.receive:
                raise ClientError("too many QoS 2 messages under way", _Reason.RECEIVE_MAX_EXCEEDED)
            session.received.add(identifier)
            heard = self._hub.publish(packet, session)
        code = mqtt5.PubRecReasonCode(0 if heard else 0x10)
        self._write([mqtt5.PubRecPacket(identifier, reason_code=code)])

    def _on_pubrec(self, packet: mqtt5.PubRecPacket, session: Session) -> None:
        """Release a QoS 2 message that the client has."""
        if release := session.on_pubrec(packet):
            self._write([release])

    def _on_pubrel(self, packet: mqtt5.PubRelPacket, session: Session) -> None:
        """Complete a QoS 2 message of the client."""
        code = mqtt5.PubCompReasonCode(0 if packet.packet_id in session.received else 0x92)
        session.received.discard(packet.packet_id)
        self._write([mqtt5.PubCompPacket(packet.packet_id, reason_code=code)])

    def _on_subscribe(self, packet: mqtt5.SubscribePacket, session: Session) -> None:
        """Add subscriptions; a shared one is refused."""
        codes = []
        for options in packet.topic_filters:
            if _is_wrong(check_filter, options.pattern):
                raise ClientError(f"the filter {options.pattern!r}", _Reason.TOPIC_FILTER_INVALID)
            if options.pattern.startswith("$share/"):
                codes.append(mqtt5.SubAckReasonCode.SHARED_SUBSCRIPTIONS_NOT_SUPPORTED)
                continue
            codes.append(mqtt5.SubAckReasonCode(int(options.max_qos)))
            self._hub.subscribe(session, Subscription(options, packet.subscription_id))
        self._write([mqtt5.SubAckPacket(packet.packet_id, codes)])

    def _on_unsubscribe(self, packet: mqtt5.UnsubscribePacket, session: Session) -> None:
        """Remove subscriptions."""
        found = [self._hub.unsubscribe(session, pattern) for pattern in packet.patterns]
        codes = [mqtt5.UnsubAckReasonCode(0 if one else 0x11) for one in found]
        self._write([mqtt5.UnsubAckPacket(packet.packet_id, codes)])

    def _on_disconnect(self, packet: mqtt5.DisconnectPacket, session: Session) -> None:
        """Let the client go; its will stays unsaid unless it asks for it."""
        if packet.reason_code == _Reason.NORMAL_DISCONNECTION:
            self._will = None
        if packet.session_expiry_interval and not session.expiry:
            raise ClientError("a session that was to end is to last", _Reason.PROTOCOL_ERROR)
        if packet.session_expiry_interval is not None:
            session.expiry = packet.session_expiry_interval
        self._leave()
        self._close()

    def _end(self, why: str, reason: mqtt5.DisconnectReasonCode) -> None:
        """End the connection; an MQTT 5 client that was let in is told the reason."""
        logger.info("the client %r is disconnected: %s", self.client_id, why)
        if self._session and self._decoder.protocol == 5:
            self._write([mqtt5.DisconnectPacket(reason_code=reason)])
        self._leave()
        self._close()

    def _leave(self) -> None:
        """Take leave of the hub, once."""
        session, self._session = self._session, None
        will, self._will = self._will, None
        if session:
            self._hub.leave(session, will)

    def _close(self) -> None:
        """Close once everything is written; a client that does not read is cut off by ``watch``."""
        self._patience = self._hub.limits.connect_timeout
        self._heard = self._hub.clock.monotonic()
        self._closing = True
        if self._transport:
            self._transport.close()

    def _write(self, packets: list[mqtt5.Packet]) -> None:
        """Write packets in one send; what is larger than the client takes is left out."""
        if self._transport is None or self._forgotten or self._closing:
            return
        frames = [encode(packet, self._decoder.protocol or 5) for packet in packets]
        self._transport.write(b"".join([frame for frame in frames if len(frame) <= self._packet_limit]))


def _is_wrong(check: Callable[[str], str], text: str) -> bool:
    """Tell whether a topic or filter is one that MQTT forbids."""
    try:
        check(text)
    except ValueError:
        return True
    return False
