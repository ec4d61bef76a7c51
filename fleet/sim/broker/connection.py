"""One client's network connection at the broker: bytes in, bytes out, time-outs."""

from __future__ import annotations

import asyncio
import logging

import mqtt5

from fleet.cloud.packets import PacketDecoder, PacketTooLarge, encode
from fleet.errors import WireError
from fleet.sim.broker.conversation import ClientError, Conversation
from fleet.sim.broker.hub import BrokerCore

logger = logging.getLogger(__name__)

_Reason = mqtt5.DisconnectReasonCode


class BrokerConnection(asyncio.Protocol):
    """Serves one client; whatever it sends can end only its own connection."""

    def __init__(self, hub: BrokerCore, everyone: set[BrokerConnection]) -> None:
        self._hub = hub
        self._everyone = everyone
        self._decoder = PacketDecoder(None, hub.limits.packet)
        self._conversation = Conversation(hub, self)
        self._transport: asyncio.Transport | None = None
        self._full = False
        self._closing = False
        self._forgotten = False
        self._asleep = False
        self._unread = b""
        self._heard = hub.clock.monotonic()

    @property
    def client_id(self) -> str:
        """Return the client's name, empty before CONNECT."""
        session = self._conversation.session
        return session.client_id if session else ""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to listen."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._everyone.add(self)

    def data_received(self, data: bytes) -> None:
        """Take what arrived and write all answers at once; a frozen broker keeps it for later."""
        if self._is_silent():
            self._sleep(data)
            return
        self._heard = self._hub.clock.monotonic()
        self._write(self._answers(data))
        if self._conversation.over:
            self._close()
        self.flush()

    def flush(self) -> None:
        """Write what waits in the client's session, as far as the socket and the client take it."""
        session, now = self._conversation.session, self._hub.clock.monotonic()
        while session and not (self._full or self._is_silent()):
            lost = self._write(session.send(now))
            if not lost:
                break
            for identifier in lost:
                session.forget(identifier)

    def expel(self, reason: mqtt5.DisconnectReasonCode) -> None:
        """End the connection; a client that can be told is told the reason."""
        logger.info("the client %r is disconnected: %s", self.client_id, reason.name)
        self._write(self._conversation.end(reason))
        self._close()

    def watch(self) -> None:
        """Go on after a freeze; end the connection when the client has been silent for too long."""
        if self._hub.faults.freeze:
            self._sleep(b"")
        elif self._asleep:
            self._wake()
        elif self._is_late():
            self._lose_patience()

    def forget(self) -> None:
        """Fall silent and forget the client while the socket stays open, as after a power cut."""
        self._forgotten = True
        self._conversation.leave()

    def drop(self) -> None:
        """Cut the connection without a word."""
        if self._transport:
            self._transport.abort()

    def pause_writing(self) -> None:
        """Let the session keep what the socket does not take; who does not listen is not listened to."""
        self._full = True
        self._read_or_wait()

    def resume_writing(self) -> None:
        """Go on where the socket stopped."""
        self._full = False
        self._read_or_wait()
        self.flush()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio passes it
        """Note that the client is gone."""
        self._everyone.discard(self)
        self._conversation.leave()

    def _is_silent(self) -> bool:
        """Tell whether nothing is read or written, because of a fault."""
        return self._forgotten or self._asleep or self._hub.faults.freeze

    def _is_late(self) -> bool:
        """Tell whether the client has been silent for too long, or does not read the last words."""
        patience = self._hub.limits.connect_timeout if self._closing else self._conversation.patience
        late = bool(patience) and self._hub.clock.monotonic() - self._heard > patience
        return late and not self._forgotten

    def _answers(self, data: bytes) -> list[mqtt5.Packet]:
        """Return what answers the packets that the bytes complete, up to the one that ends the connection."""
        answers: list[mqtt5.Packet] = []
        try:
            for packet in self._decoder.feed(data):
                answers += self._conversation.receive(packet, self._decoder.protocol)
                if self._conversation.over:
                    break
        except PacketTooLarge as error:
            answers += self._refuse(error, _Reason.PACKET_TOO_LARGE)
        except WireError as error:
            answers += self._refuse(error, _Reason.MALFORMED_PACKET)
        except ClientError as error:
            answers += self._refuse(error, error.reason)
        return answers

    def _refuse(self, error: Exception, reason: mqtt5.DisconnectReasonCode) -> list[mqtt5.Packet]:
        """End the conversation because of what the client sent; return the last words."""
        logger.info("the client %r is disconnected: %s", self.client_id, error)
        return self._conversation.end(reason)

    def _sleep(self, data: bytes) -> None:
        """Read no more for now, and keep what was read; a client that is forgotten is not listened to."""
        if not self._forgotten:
            self._asleep = True
            self._unread += data
            self._read_or_wait()

    def _wake(self) -> None:
        """Go on after a freeze."""
        self._asleep = False
        unread, self._unread = self._unread, b""
        self._read_or_wait()
        self.data_received(unread)

    def _read_or_wait(self) -> None:
        """Read from the socket unless the broker sleeps or the client does not read."""
        if self._transport is None or self._closing:
            return
        if self._asleep or self._full:
            self._transport.pause_reading()
        else:
            self._transport.resume_reading()

    def _lose_patience(self) -> None:
        """Tell a silent client to go; cut it off when it was told already."""
        if self._closing:
            self.drop()
        else:
            self.expel(_Reason.KEEP_ALIVE_TIMEOUT)

    def _close(self) -> None:
        """Close once everything is written; a client that does not read is cut off by ``watch``."""
        if self._closing:
            return
        self._closing = True
        self._heard = self._hub.clock.monotonic()
        if self._transport:
            self._transport.close()

    def _write(self, packets: list[mqtt5.Packet]) -> list[int]:
        """Write packets in one send; return the identifiers of messages larger than the client takes."""
        if self._transport is None or self._forgotten or self._closing:
            return []
        frames, lost = [], []
        for packet in packets:
            frame = encode(packet, self._decoder.protocol or 5)
            if len(frame) <= self._conversation.packet_limit:
                frames.append(frame)
            elif identifier := getattr(packet, "packet_id", None):
                lost.append(identifier)
        if frames:
            self._transport.write(b"".join(frames))
        return lost
