"""Network connection of one client at the broker: bytes in, bytes out, time-outs."""

from __future__ import annotations

import asyncio
import logging

import mqtt5

from fleet.cloud.packets import PacketDecoder, PacketTooLarge, encode
from fleet.errors import WireError
from fleet.sim.broker.broker_core import BrokerCore
from fleet.sim.broker.conversation import ClientError, Conversation

logger = logging.getLogger(__name__)

_Reason = mqtt5.DisconnectReasonCode


class ReadGate:
    """Controls reading from the socket: paused while frozen, or while the client does not read.

    ``transport`` is None before the connection and once it is being closed.
    """

    def __init__(self) -> None:
        self.transport: asyncio.Transport | None = None
        self.full = False
        self.frozen = False
        self._unread = b""

    def freeze(self, data: bytes) -> None:
        """Pause reading, and keep the bytes read so far."""
        self.frozen = True
        self._unread += data
        self._read_or_wait()

    def thaw(self) -> bytes:
        """Resume after a freeze; return the kept bytes."""
        self.frozen = False
        unread, self._unread = self._unread, b""
        self._read_or_wait()
        return unread

    def set_full(self, *, full: bool) -> None:
        """Set whether the client does not read its messages."""
        self.full = full
        self._read_or_wait()

    def _read_or_wait(self) -> None:
        if self.transport is None:
            return
        if self.frozen or self.full:
            self.transport.pause_reading()
        else:
            self.transport.resume_reading()


class BrokerConnection(asyncio.Protocol):
    """Serves one client; nothing that it sends can affect other connections."""

    def __init__(self, hub: BrokerCore, everyone: set[BrokerConnection]) -> None:
        self._hub = hub
        self._everyone = everyone
        self._decoder = PacketDecoder(None, hub.limits.packet)
        self._conversation = Conversation(hub, self)
        self._transport: asyncio.Transport | None = None
        self._reading = ReadGate()
        self._closing = False
        self._forgotten = False
        self._heard = hub.clock.monotonic()

    @property
    def client_id(self) -> str:
        """Return the client id, empty before CONNECT."""
        session = self._conversation.session
        return session.client_id if session else ""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._reading.transport = transport
        self._everyone.add(self)

    def data_received(self, data: bytes) -> None:
        """Handle received bytes and write all answers together; a frozen broker keeps the bytes for later."""
        if self._is_silent():
            if not self._forgotten:
                self._reading.freeze(data)
            return
        self._heard = self._hub.clock.monotonic()
        self._write(self._answers(data))
        if self._conversation.over:
            self._close()
        self.flush()

    def flush(self) -> None:
        """Write waiting messages of the client's session, as far as the socket and the client accept them."""
        session, now = self._conversation.session, self._hub.clock.monotonic()
        while session and not (self._reading.full or self._is_silent()):
            lost = self._write(session.send(now))
            if not lost:
                break
            for identifier in lost:
                session.forget(identifier)

    def disconnect_client(self, reason: mqtt5.DisconnectReasonCode) -> None:
        """End the connection; send the reason to a client whose protocol allows it."""
        logger.info("the client %r is disconnected: %s", self.client_id, reason.name)
        self._write(self._conversation.end(reason))
        self._close()

    def watch(self) -> None:
        """Resume after a freeze; end the connection if the client has been silent for too long."""
        if self._hub.faults.freeze:
            if not self._forgotten:
                self._reading.freeze(b"")
        elif self._reading.frozen:
            self.data_received(self._reading.thaw())
        elif self._is_late():
            self._time_out_waiting()

    def forget(self) -> None:
        """Go silent and drop the client's state while the socket stays open, as after a power cut."""
        self._forgotten = True
        self._conversation.leave()

    def drop(self) -> None:
        """Abort the connection without DISCONNECT."""
        if self._transport:
            self._transport.abort()

    def pause_writing(self) -> None:
        """Pause writing, and also reading from a client that does not read."""
        self._reading.set_full(full=True)

    def resume_writing(self) -> None:
        """Resume writing and reading."""
        self._reading.set_full(full=False)
        self.flush()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio passes it
        """Handle the loss of the connection."""
        self._everyone.discard(self)
        self._conversation.leave()

    def _is_silent(self) -> bool:
        """Return True if a fault stops reading and writing."""
        return self._forgotten or self._reading.frozen or self._hub.faults.freeze

    def _is_late(self) -> bool:
        """Return True if the client has been silent for too long, or does not read the last packets."""
        patience = self._hub.limits.connect_timeout if self._closing else self._conversation.patience
        late = bool(patience) and self._hub.clock.monotonic() - self._heard > patience
        return late and not self._forgotten

    def _answers(self, data: bytes) -> list[mqtt5.Packet]:
        """Return the answers to the completed packets, up to one that ends the connection."""
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
        """End the conversation because of a bad packet; return the last packets to send."""
        logger.info("the client %r is disconnected: %s", self.client_id, error)
        return self._conversation.end(reason)

    def _time_out_waiting(self) -> None:
        """Disconnect a silent client; abort the connection if that was tried already."""
        if self._closing:
            self.drop()
        else:
            self.disconnect_client(_Reason.KEEP_ALIVE_TIMEOUT)

    def _close(self) -> None:
        """Close after everything is written; ``watch`` aborts if the client does not read."""
        if self._closing:
            return
        self._closing = True
        self._reading.transport = None
        self._heard = self._hub.clock.monotonic()
        if self._transport:
            self._transport.close()

    def _write(self, packets: list[mqtt5.Packet]) -> list[int]:
        """Write packets in one send; return the ids of messages that are too large for the client."""
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
