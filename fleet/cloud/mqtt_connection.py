"""One network connection that carries one session: bytes in and out, and nothing else."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import threading
from collections.abc import Callable, Mapping
from typing import Any

import mqtt5

from fleet.clock import Clock
from fleet.cloud.broker_socket import BrokerSocket
from fleet.cloud.inbound import HEAD, reader, recover_publish
from fleet.cloud.keepalive import Keepalive, KeepaliveAction
from fleet.cloud.mqtt_session import MqttSession, SessionEnded
from fleet.cloud.packets import PacketFramer, encode
from fleet.cloud.spaced_call import SpacedCall
from fleet.cloud.values import PAYLOAD_LIMIT, CloudMessage, CloudSettings
from fleet.errors import CloudError, WireError

logger = logging.getLogger(__name__)

TLS_ALERT = b"\x15\x03"  # how a server with TLS answers what is none (RFC 8446, 5.1 and 6)
TRY_TLS = "try tls: true"
MOST_READS = 64
"""Reads of one look of the thread that stands by: the loop may want the connection back."""
WRITE_SPACING = 0.002
"""Seconds between two writes of messages that may wait, such as status and events.

Each write costs a system call here, and a wake-up for its acknowledgements. On a fast computer every message
of a stream had its own.
"""
_LARGE_WRITE = 8 * 1024  # bytes after which the rest of what waits follows in the next turn of the loop
LONGEST_LOOK = 0.01
"""Seconds after which it reads no more: of small messages so many reads would take it some."""

Deliver = Callable[[list[CloudMessage]], None]


class _NextTurnCall:
    """A call that the loop makes in its next turn, once however often it is asked for until then.

    It refers to what is called only until then. A connection that held it for good would be in a circle of
    references with it, and the garbage collector runs seldom: a broker that is reached and lost again and
    again would cost memory each time.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._asked = False

    def __call__(self, call: Callable[[], None]) -> None:
        if not self._asked:
            self._asked = True
            self._loop.call_soon(self._make, call)

    def _make(self, call: Callable[[], None]) -> None:
        self._asked = False
        call()


class MqttConnection:
    """Feeds the session with what arrives and writes what it answers; on the loop.

    Only ``stand_in`` is called on another thread, when the loop does not read what has arrived. What one read
    brings is handed over by ``deliver`` there and then, in order, and the loop calls ``take`` afterwards,
    again and again while that returns True.

    ``spaced`` makes writes that may wait share one: ``spaced(flush)``.
    ``ready`` is done when the broker has answered CONNECT and every subscription; ``ended`` holds the reason
    (SessionRefused, SessionEnded or CloudError) once the connection is of no more use.
    """

    def __init__(
        self,
        opened: socket.socket,
        session: MqttSession,
        settings: CloudSettings,
        clock: Clock,
        *,
        deliver: Deliver,
        take: Callable[[], bool],
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self.ready: asyncio.Future[None] = self._loop.create_future()
        self.ended: asyncio.Future[CloudError] = self._loop.create_future()
        self.gone: asyncio.Future[None] = self._loop.create_future()
        self._session = session
        self._protocol = settings.protocol
        self._clock = clock
        self._silent = not settings.tls  # a plain connection on which nothing was heard yet
        self._deliver = deliver
        self._take = take
        self._take_on = _NextTurnCall(self._loop)  # the rest, others having had their turn
        self._go_on = _NextTurnCall(self._loop)
        self.spaced = SpacedCall(self._loop, clock, WRITE_SPACING)
        self._arrivals = PacketFramer(reader(settings.protocol), PAYLOAD_LIMIT, head=HEAD)
        self._keepalive = Keepalive(settings.keepalive, clock.monotonic())
        self._lock = threading.Lock()  # of everything that reading and writing share
        self._failure: CloudError | None = None
        self._reads = 0
        self._seen = -1
        self._stream = BrokerSocket(opened, self._readable, self._writable)
        self._write(session.connect())

    @property
    def full(self) -> bool:
        """True while the network does not take what is to be written."""
        return self._stream.full

    @property
    def patience(self) -> float:
        """Return how often, in seconds, ``watch`` wants to be called."""
        return min(1.0, self._keepalive.interval / 20 or 1.0)

    def stand_in(self) -> bool:
        """Read and acknowledge what the loop has left since the last look, and ping; on another thread.

        What is not acknowledged keeps what follows it back: a broker sends only so many messages ahead. So
        what the loop has read itself, and then got stuck over, is acknowledged here, too.
        What it means for the connection is done by the loop, once it goes on. Returns True when something
        was read: more may follow at once.
        """
        with self._lock:
            waiting = self._failure is None and self._stream.waiting()
            owing = self._failure is None and self._session.owes
            stuck = self._seen == self._reads
            neglected = waiting and stuck
            if neglected:
                self._receive_all()
            elif owing and stuck:
                self._write(self._session.take_replies())
            self._seen = self._reads if waiting or owing else -1
            self._ping()
        if neglected:
            with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                self._loop.call_soon_threadsafe(self._follow_up)
        return neglected

    def _readable(self) -> None:
        """Take what has arrived; on the loop."""
        with self._lock:
            self._receive()
        self._follow_up()

    def _follow_up(self) -> None:
        """Do what follows from what was read: what is asked of robots begins before anybody is answered."""
        more = False
        try:
            more = self._take()
        except Exception:
            logger.exception("taking what was handed over failed")
        if more:
            self._take_on(self._follow_up)
        self._loop.call_soon(self._conclude)

    def _writable(self) -> None:
        """Write what had to wait, and go on where the socket stopped: the link is slow, and alive."""
        with self._lock:
            self._stream.write_rest()
            self._keepalive.received(self._clock.monotonic())
        self.flush()

    def _receive_all(self) -> None:
        """Read all that has arrived, within reason, and acknowledge it."""
        end = self._clock.monotonic() + LONGEST_LOOK
        for _ in range(MOST_READS):
            self._receive()
            if self._failure is not None:
                return
            self._write(self._session.take_replies())
            if not self._stream.waiting() or self._clock.monotonic() > end:
                return

    def _receive(self) -> None:
        """Read, and hand over the messages; a failure waits for the loop, nothing is believed after it."""
        if self._stream.closed or self._failure is not None:
            return
        now = self._clock.monotonic()
        self._reads += 1
        try:
            data = self._stream.read()
            if self.ended.done():
                return  # after a goodbye nothing counts but the end
            self._silent = _still_silent(data) if self._silent else False
            self._keepalive.received(now)
            for packet in self._arrivals.feed(data):
                self._session.receive(packet, now)
        except OSError as error:
            hint = f" before it said anything; if it wants TLS, {TRY_TLS}" * self._silent
            self._failure = CloudError(f"the connection to the broker fell: {error}{hint}")
        except WireError as error:
            message = recover_publish(error)
            if message is not None:
                self._session.take(message)
            code = mqtt5.DisconnectReasonCode.MALFORMED_PACKET
            self._failure = SessionEnded(f"the broker sent {error}", code)
        except CloudError as error:
            self._failure = error.with_traceback(None)  # whose frames would keep this connection alive
        except Exception as error:
            logger.exception("reading what the broker sent failed in a way that was not foreseen")
            self._failure = CloudError(f"{type(error).__name__}: {error}")
        if messages := self._session.take_messages():
            self._deliver(messages)

    def _conclude(self) -> None:
        """Answer the broker what was read, and send what that lets go."""
        if self.ended.done():
            if self._failure is not None and not self.gone.done():
                self.gone.set_result(None)  # the broker has closed its side, too, after a goodbye
            return
        if self._failure is None and self.ready.done() and not self._session.answers:
            return
        with self._lock:
            self._write(self._session.take_replies())
        if self._failure is not None:
            self.give_up(self._failure)
        if self._session.ready and not self.ready.done():
            self._keepalive.interval = self._session.keepalive  # from now on the broker's own counts
            self.ready.set_result(None)
            self.flush()
        self.spaced(self.flush)

    def resubscribe(self, subscriptions: Mapping[str, int]) -> None:
        """Subscribe to other filters from now on; on the loop."""
        with self._lock:
            self._session.resubscribe(subscriptions)
            self._write(self._session.take_replies())

    def flush(self) -> None:
        """Write some of what waits, as far as the broker's window and the socket take it, and soon the rest.

        What arrives has its turn in between: a command does not wait until a burst of states is written.
        """
        if self.ended.done() or self._stream.full:
            return
        now = self._clock.monotonic()
        with self._lock:
            data = self._session.send(now)
            self._write(data)
        if data:
            self.spaced.mark(now)
            large = len(data) >= _LARGE_WRITE
            self._go_on(self.flush if large else lambda: self.spaced(self.flush))

    async def answered(self) -> None:
        """Wait until the connection is ready, or ended before it was."""
        waited: list[asyncio.Future[Any]] = [self.ready, self.ended]
        await asyncio.wait(waited, return_when=asyncio.FIRST_COMPLETED)

    def busy(self) -> bool:
        """Tell whether messages wait or are not acknowledged yet."""
        return not self.ended.done() and self._session.busy()

    def watch(self) -> None:
        """Ping a quiet link and give up a dead one."""
        with self._lock:
            dead = self._ping() is KeepaliveAction.GIVE_UP
        if dead:
            self.give_up(CloudError(f"the broker has been silent for {self._keepalive.limit:.1f} s"))

    def give_up(self, reason: CloudError) -> None:
        """End the connection; the broker is told why where the reason has a code for it."""
        code = reason.code if isinstance(reason, SessionEnded) and self._protocol == 5 else None
        with self._lock:
            if code is not None:
                self._write(encode(mqtt5.DisconnectPacket(reason_code=code), self._protocol))
            self._end(reason)
            # What the kernel still holds of states from before a network fell silent would else arrive as
            # news when that comes back.
            self._stream.close(reset=code is None)

    async def leave(self, patience: float) -> None:
        """Say goodbye, so that the broker keeps the will to itself, and close within ``patience`` seconds."""
        with self._lock:
            self._write(encode(mqtt5.DisconnectPacket(), self._protocol))
            self._end(CloudError("closed"))
            self._stream.shut()
        await asyncio.wait([self.gone], timeout=patience)
        with self._lock:
            self._stream.close(reset=True)

    def _ping(self) -> KeepaliveAction:
        """Ping when that is due; return what is."""
        due = self._keepalive.due(self._clock.monotonic())
        if due is KeepaliveAction.PING and self._session.connected:
            self._write(encode(mqtt5.PingReqPacket(), self._protocol))
        return due

    def _end(self, reason: CloudError) -> None:
        """Keep the first reason."""
        if not self.ended.done():
            self._session.ready = False
            self.ended.set_result(reason)

    def _write(self, data: bytes) -> None:
        """Hand bytes to the socket."""
        if data and not self.ended.done() and not self._stream.closed:
            self._stream.write(data)
            self._keepalive.sent(self._clock.monotonic())


def _still_silent(data: bytes) -> bool:
    """Look at the first bytes of a plain connection; raises CloudError when they are of TLS."""
    if data.startswith(TLS_ALERT):
        raise CloudError(f"the broker answers with TLS; {TRY_TLS}")
    return not data
