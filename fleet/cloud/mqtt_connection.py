"""One network connection of an MQTT session: moves bytes between socket and session."""

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

TLS_ALERT = b"\x15\x03"  # a TLS server's answer to plain MQTT: an alert record (RFC 8446, 5.1 and 6)
TRY_TLS = "try tls: true"
MOST_READS = 64
"""Reads of the fallback reader in one go: the loop may want the connection back."""
WRITE_SPACING = 0.002
"""Seconds between two writes of messages that may wait, such as status and events.

Each write costs a system call, and a wake-up for its acknowledgements. On a fast computer every message of a
stream would have its own write.
"""
_LARGE_WRITE = 8 * 1024  # bytes from which the rest of the queue follows in the next iteration of the loop
LONGEST_READ = 0.01
"""Seconds after which the fallback reader stops reading: so many small messages would take longer."""

Deliver = Callable[[list[CloudMessage]], None]


class _NextIterationCall:
    """Schedules a call for the next iteration of the loop; repeated requests are merged.

    It refers to the callee only until the call. A permanent reference would form a cycle with the connection,
    and the garbage collector runs rarely: each reconnect to an unstable broker would cost memory.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._requested = False

    def __call__(self, call: Callable[[], None]) -> None:
        if not self._requested:
            self._requested = True
            self._loop.call_soon(self._make, call)

    def _make(self, call: Callable[[], None]) -> None:
        self._requested = False
        call()


class MqttConnection:
    """Passes received bytes to the session and writes its answers; on the loop.

    Only ``read_for_loop`` is called on another thread, when the loop does not read. The messages of one read
    go to ``deliver`` immediately, in order. Afterwards the loop calls ``take``, again and again while that
    returns True.

    ``spaced`` merges writes that may wait into one: ``spaced(flush)``. ``ready`` is done when the broker has
    answered CONNECT and all subscriptions. ``ended`` holds the reason (SessionRefused, SessionEnded or
    CloudError) once the connection is unusable.
    """

    def __init__(
        self,
        opened: socket.socket,
        session: MqttSession,
        settings: CloudSettings,
        clock: Clock,
        *,
        deliver: Deliver,
        dispatch: Callable[[], bool],
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self.ready: asyncio.Future[None] = self._loop.create_future()
        self.ended: asyncio.Future[CloudError] = self._loop.create_future()
        self.gone: asyncio.Future[None] = self._loop.create_future()
        self._session = session
        self._protocol = settings.protocol
        self._clock = clock
        self._silent = not settings.tls  # plain connection that has received nothing yet
        self._deliver = deliver
        self._dispatch = dispatch
        self._dispatch_again = _NextIterationCall(self._loop)  # the rest, after other work of the loop
        self._flush_again = _NextIterationCall(self._loop)
        self.spaced = SpacedCall(self._loop, clock, WRITE_SPACING)
        self._framer = PacketFramer(reader(settings.protocol), PAYLOAD_LIMIT, head=HEAD)
        self._keepalive = Keepalive(settings.keepalive, clock.monotonic())
        self._lock = threading.Lock()  # guards all state shared by reading and writing
        self._failure: CloudError | None = None
        self._reads = 0
        self._seen = -1
        self._stream = BrokerSocket(opened, self._readable, self._writable)
        self._write(session.connect())

    @property
    def full(self) -> bool:
        """True while the network does not accept data."""
        return self._stream.full

    @property
    def watch_interval(self) -> float:
        """The interval, in seconds, at which ``watch`` must be called."""
        return min(1.0, self._keepalive.interval / 20 or 1.0)

    def read_for_loop(self) -> bool:
        """Read and acknowledge data that the loop has left since the last call, and ping; on another thread.

        Unacknowledged messages block those behind them, because the broker's window is limited. So messages
        that the loop has read before it got stuck are acknowledged here too. The loop handles the
        consequences once it runs again. Return True when data was read: more may follow.
        """
        with self._lock:
            waiting = self._failure is None and self._stream.waiting()
            owing = self._failure is None and self._session.owes_reply
            stuck = self._seen == self._reads
            neglected = waiting and stuck
            if neglected:
                self._receive_all()
            elif owing and stuck:
                self._write(self._session.take_replies())
            self._seen = self._reads if waiting or owing else -1
            self._ping()
        if neglected:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._follow_up)
        return neglected

    def _readable(self) -> None:
        """Read the data that has arrived; on the loop."""
        with self._lock:
            self._receive()
        self._follow_up()

    def _follow_up(self) -> None:
        """Dispatch the messages that were read: robots get requests before the broker gets its answers."""
        more = False
        try:
            more = self._dispatch()
        except Exception:
            logger.exception("dispatching received messages failed")
        if more:
            self._dispatch_again(self._follow_up)
        if more or self._failure is not None or self._session.owes_reply or not self.ready.done():
            self._loop.call_soon(self._conclude)
        elif self._session.answers:  # only acknowledgements: thousands a second, which need no turn each
            self.spaced(self.flush)

    def _writable(self) -> None:
        """Write the buffered data and continue sending.

        A socket with room again also proves that the slow link is alive.
        """
        with self._lock:
            self._stream.write_rest()
            self._keepalive.received(self._clock.monotonic())
        self.flush()

    def _receive_all(self) -> None:
        """Read and acknowledge all data that has arrived, within the bounds."""
        end = self._clock.monotonic() + LONGEST_READ
        for _ in range(MOST_READS):
            self._receive()
            if self._failure is not None:
                return
            self._write(self._session.take_replies())
            if not self._stream.waiting() or self._clock.monotonic() > end:
                return

    def _receive(self) -> None:
        """Read once and deliver the messages; after a failure, left to the loop, nothing more is read."""
        if self._stream.closed or self._failure is not None:
            return
        now = self._clock.monotonic()
        self._reads += 1
        try:
            data = self._stream.read()
            if self.ended.done():
                return  # after our DISCONNECT only the end counts
            self._silent = _still_silent(data) if self._silent else False
            self._keepalive.received(now)
            for packet in self._framer.feed(data):
                self._session.receive(packet, now)
        except OSError as error:
            hint = f" before it said anything; if it wants TLS, {TRY_TLS}" * self._silent
            self._failure = CloudError(f"the connection to the broker was lost: {error}{hint}")
        except WireError as error:
            message = recover_publish(error)
            if message is not None:
                self._session.enqueue(message)
            code = mqtt5.DisconnectReasonCode.MALFORMED_PACKET
            self._failure = SessionEnded(f"the broker sent {error}", code)
        except CloudError as error:
            self._failure = error.with_traceback(None)  # its frames would keep this connection alive
        except Exception as error:
            logger.exception("unexpected error while reading from the broker")
            self._failure = CloudError(f"{type(error).__name__}: {error}")
        if messages := self._session.take_messages():
            self._deliver(messages)

    def _conclude(self) -> None:
        """Send the answers to what was read, and the messages that acknowledgements made room for."""
        if self.ended.done():
            if self._failure is not None and not self.gone.done():
                self.gone.set_result(None)  # the broker has closed its side after our DISCONNECT
            return
        if self._failure is None and self.ready.done() and not self._session.answers:
            return
        with self._lock:
            self._write(self._session.take_replies())
        if self._failure is not None:
            self.give_up(self._failure)
        if self._session.ready and not self.ready.done():
            self._keepalive.interval = self._session.keepalive  # the broker's keepalive replaces ours
            self.ready.set_result(None)
            self.flush()
        self.spaced(self.flush)

    def resubscribe(self, subscriptions: Mapping[str, int]) -> None:
        """Replace the filters; on the loop."""
        with self._lock:
            self._session.resubscribe(subscriptions)
            self._write(self._session.take_replies())

    def flush(self) -> None:
        """Write a part of the queue, as far as the broker's window and the socket allow; schedule the rest.

        Data that arrives is handled in between: a command does not wait for a burst of states.
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
            self._flush_again(self.flush if large else lambda: self.spaced(self.flush))

    async def wait_ready(self) -> None:
        """Wait until the connection is ready, or ends before."""
        waited: list[asyncio.Future[Any]] = [self.ready, self.ended]
        await asyncio.wait(waited, return_when=asyncio.FIRST_COMPLETED)

    def busy(self) -> bool:
        """Return whether messages wait or are not acknowledged yet."""
        return not self.ended.done() and self._session.busy()

    def watch(self) -> None:
        """Ping a quiet link and close a dead one."""
        with self._lock:
            dead = self._ping() is KeepaliveAction.GIVE_UP
        if dead:
            self.give_up(CloudError(f"the broker has been silent for {self._keepalive.limit:.1f} s"))

    def give_up(self, reason: CloudError) -> None:
        """Close the connection; send the reason to the broker if it has a reason code."""
        code = reason.code if isinstance(reason, SessionEnded) and self._protocol == 5 else None
        with self._lock:
            if code is not None:
                self._write(encode(mqtt5.DisconnectPacket(reason_code=code), self._protocol))
            self._end(reason)
            # Otherwise states that the kernel still holds from before a network outage would arrive as
            # new ones after it.
            self._stream.close(reset=code is None)

    async def disconnect(self, patience: float) -> None:
        """Disconnect so that the broker discards the will, and close within ``patience`` seconds."""
        with self._lock:
            self._write(encode(mqtt5.DisconnectPacket(), self._protocol))
            self._end(CloudError("closed"))
            self._stream.close_write()
        await asyncio.wait([self.gone], timeout=patience)
        with self._lock:
            self._stream.close(reset=True)

    def _ping(self) -> KeepaliveAction:
        """Ping if one is due; return the due action."""
        due = self._keepalive.due(self._clock.monotonic())
        if due is KeepaliveAction.PING and self._session.connected:
            self._write(encode(mqtt5.PingReqPacket(), self._protocol))
        return due

    def _end(self, reason: CloudError) -> None:
        """Record the reason of the end; only the first one counts."""
        if not self.ended.done():
            self._session.ready = False
            self.ended.set_result(reason)

    def _write(self, data: bytes) -> None:
        """Write bytes to the socket."""
        if data and not self.ended.done() and not self._stream.closed:
            self._stream.write(data)
            self._keepalive.sent(self._clock.monotonic())


def _still_silent(data: bytes) -> bool:
    """Check the first bytes of a plain connection; raises CloudError if they are TLS."""
    if data.startswith(TLS_ALERT):
        raise CloudError(f"the broker answers with TLS; {TRY_TLS}")
    return not data
