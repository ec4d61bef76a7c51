"""One network connection that carries one session: bytes in and out, and nothing else."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import Callable
from typing import Any, cast

import mqtt5

from fleet.clock import Clock
from fleet.cloud.keepalive import Due, Keepalive
from fleet.cloud.packets import Decoder, encode
from fleet.cloud.session import Session, SessionEnded
from fleet.cloud.values import PAYLOAD_LIMIT, CloudSettings, Message
from fleet.errors import CloudError, WireError
from fleet.spool.message import Outcome, Outgoing

AT_ONCE = struct.pack("ii", 1, 0)  # SO_LINGER: a close is a reset

Deliver = Callable[[list[Message]], None]
Settle = Callable[[list[tuple[Outgoing, Outcome]]], None]


class Connection(asyncio.Protocol):
    """Feeds the session with what arrives and writes what it answers; all on the cloud thread.

    ``ready`` is done when the broker has answered CONNECT and every subscription; ``ended`` holds the reason
    (SessionRefused, SessionEnded or CloudError) once the connection is of no more use.
    """

    def __init__(
        self, session: Session, settings: CloudSettings, clock: Clock, deliver: Deliver, settle: Settle
    ) -> None:
        loop = asyncio.get_running_loop()
        self.ready: asyncio.Future[None] = loop.create_future()
        self.ended: asyncio.Future[CloudError] = loop.create_future()
        self.gone: asyncio.Future[None] = loop.create_future()
        self._session = session
        self._protocol = settings.protocol
        self._clock = clock
        self._deliver = deliver
        self._settle = settle
        self._decoder = Decoder(settings.protocol, PAYLOAD_LIMIT)
        self._keepalive = Keepalive(settings.keepalive, clock.monotonic())
        self._transport: asyncio.Transport | None = None
        self._paused = False
        self._going_on = False

    @property
    def patience(self) -> float:
        """Return how often, in seconds, ``watch`` wants to be called."""
        return min(1.0, self._keepalive.interval / 20 or 1.0)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Say CONNECT. asyncio has set TCP_NODELAY: without it replies wait 40 ms for one another's ack."""
        self._transport = cast("asyncio.Transport", transport)
        self._write(self._session.connect())

    def data_received(self, data: bytes) -> None:
        """Take what one read brought: all its messages are delivered at once, all answers written at once."""
        now = self._clock.monotonic()
        self._keepalive.received(now)
        error: CloudError | None = None
        try:
            for packet in self._decoder.feed(bytes(data)):
                self._session.receive(packet, now)
        except WireError as broken:
            error = SessionEnded(f"the broker sent {broken}", mqtt5.DisconnectReasonCode.MALFORMED_PACKET)
        except CloudError as ended:
            error = ended
        if messages := self._session.take_messages():
            self._deliver(messages)
        if error is None and self.ready.done() and not self._session.answers:
            return  # a message that asks no answer: who it was handed to wants the interpreter now
        self._write(self._session.take_replies())
        if error:
            self.give_up(error)
        self._note_ready()
        self.flush()

    def flush(self) -> None:
        """Write some of what waits, as far as the broker's window and the socket take it, and soon the rest.

        What arrives has its turn in between: a command does not wait until a burst of states is written.
        """
        if self._paused or self.ended.done():
            return
        data = self._session.send(self._clock.monotonic())
        self._write(data)
        self._settle(self._session.take_outcomes())
        if data and not self._going_on:
            self._going_on = True
            asyncio.get_running_loop().call_soon(self._go_on)

    def _go_on(self) -> None:
        """Write the rest."""
        self._going_on = False
        self.flush()

    async def answered(self) -> None:
        """Wait until the connection is ready, or ended before it was."""
        waited: list[asyncio.Future[Any]] = [self.ready, self.ended]
        await asyncio.wait(waited, return_when=asyncio.FIRST_COMPLETED)

    def busy(self) -> bool:
        """Tell whether messages wait or are not acknowledged yet."""
        return not self.ended.done() and self._session.busy()

    def watch(self) -> None:
        """Ping a quiet link and give up a dead one."""
        due = self._keepalive.due(self._clock.monotonic())
        if due is Due.PING and self._session.connected:
            self._write(encode(mqtt5.PingReqPacket(), self._protocol))
        elif due is Due.GIVE_UP:
            self.give_up(CloudError(f"the broker has been silent for {self._keepalive.limit:.1f} s"))

    def give_up(self, reason: CloudError) -> None:
        """End the connection; the broker is told why where the reason has a code for it."""
        code = reason.code if isinstance(reason, SessionEnded) and self._protocol == 5 else None
        if code is not None:
            self._write(encode(mqtt5.DisconnectPacket(reason_code=code), self._protocol))
        self._end(reason)
        if self._transport and code is None:
            _reset(self._transport)
        elif self._transport:
            self._transport.close()

    async def leave(self, patience: float) -> None:
        """Say goodbye, so that the broker keeps the will to itself, and close within ``patience`` seconds."""
        self._write(encode(mqtt5.DisconnectPacket(), self._protocol))
        self._end(CloudError("closed"))
        if self._transport is None:
            return
        self._transport.close()
        await asyncio.wait([self.gone], timeout=patience)
        self._transport.abort()

    def pause_writing(self) -> None:
        """Let the outbox keep what the socket does not take."""
        self._paused = True

    def resume_writing(self) -> None:
        """Go on where the socket stopped."""
        self._paused = False
        self.flush()

    def connection_lost(self, exc: Exception | None) -> None:
        """Note that the connection is gone."""
        self._end(CloudError(f"the connection to the broker fell: {exc or 'closed by the other side'}"))
        self.gone.set_result(None)

    def _note_ready(self) -> None:
        """Tell who waits that messages can flow; from then on the broker's own keepalive counts."""
        if self._session.ready and not self.ready.done():
            self._keepalive.interval = self._session.keepalive
            self.ready.set_result(None)

    def _end(self, reason: CloudError) -> None:
        """Keep the first reason."""
        if not self.ended.done():
            self._session.ready = False
            self.ended.set_result(reason)

    def _write(self, data: bytes) -> None:
        """Hand bytes to the socket."""
        if data and self._transport and not self.ended.done() and not self._transport.is_closing():
            self._transport.write(data)
            self._keepalive.sent(self._clock.monotonic())


def _reset(transport: asyncio.Transport) -> None:
    """End a connection with nothing left of it, unless it is ending already.

    What the kernel still holds of states from before a network fell silent would else arrive as news when
    that comes back.
    """
    if not transport.is_closing():
        opened = transport.get_extra_info("socket")
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
    transport.abort()
