"""MQTT client of the cloud: keeps a session connected and delivers messages.

It runs on the event loop, so that commands are read and executed without a change of threads. A thread, the
fallback reader, reads and pings while the loop is stuck.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable, Mapping
from functools import partial

import msgspec

from fleet.clock import Clock
from fleet.cloud import endpoint
from fleet.cloud.fallback_reader import FallbackReader
from fleet.cloud.mqtt_connection import TRY_TLS, MqttConnection
from fleet.cloud.mqtt_session import MqttSession, SessionRefused
from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.publish import Qos0Route, qos0_route
from fleet.cloud.reconnect_backoff import Backoff
from fleet.cloud.topics import check_apart, check_topic
from fleet.cloud.values import CloudMessage, CloudSettings, CloudState, CloudStats
from fleet.errors import CloudError
from fleet.runtime.exception_barrier import guarded, log_exceptions
from fleet.spool.message import Outgoing
from fleet.spool.queue import NEWEST_FIRST
from fleet.spool.spool import Spool, SpoolSettings
from fleet.wire.rules import TrafficClass

logger = logging.getLogger(__name__)


class DurableRoute(msgspec.Struct, frozen=True):
    """Publish route of durable messages: topic, QoS, traffic class, and seconds until expiry."""

    topic: str
    qos: int
    traffic: TrafficClass
    expiry: float | None


PublishRoute = Qos0Route | DurableRoute


class CloudClient:
    """An MQTT client that reconnects by itself and never blocks the publisher.

    ``subscriptions`` maps filters to QoS; they are renewed after every reconnect. The client does not receive
    its own messages (MQTT 5 only; 3.1.1 has no such option). ``on_message`` gets all messages of one read, in
    order. It must only hand them over: it runs on the loop or, while the loop is stuck, on the fallback
    reader's thread, and nothing else is read meanwhile. The loop then calls ``on_read``. The other callbacks
    run on the loop. ``spool`` stores durable messages (default: one in memory only); it is closed with the
    client. Raises ValueError for filters that overlap, CloudError for settings that are unsafe or unusable.
    """

    def __init__(
        self,
        settings: CloudSettings,
        subscriptions: Mapping[str, int],
        *,
        on_message: Callable[[list[CloudMessage]], None],
        on_read: Callable[[], bool],
        on_state: Callable[[CloudState, str], None],
        clock: Clock,
        spool: Spool | None = None,
    ) -> None:
        check_apart(subscriptions)
        self.state = CloudState.DISCONNECTED
        self.cause = "not started"
        self.stats = CloudStats()
        self._settings = settings
        self._tls = endpoint.tls_context(settings)
        self._subscriptions = dict(subscriptions)
        self._on_message = on_message
        self._on_read = on_read
        self._on_state = on_state
        self._clock = clock
        self.spool = spool or Spool(SpoolSettings(), clock)
        self.spool.more = self.flush
        most = settings.queue_messages, settings.queue_bytes
        self._outbox = OutboundQueue(self.spool, *most, self.stats, clock)
        self._network = Backoff(*settings.backoff)
        self._refusals = Backoff(*settings.refused_backoff)
        self._fallback_reader = FallbackReader(
            lambda: bool((one := self._connection) and one.read_for_loop())
        )
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread = 0  # id of the loop's thread
        self._work: asyncio.Task[None] | None = None
        self._stopping = asyncio.Event()
        self._closed = threading.Event()
        self._patience = 0.0
        self._connection: MqttConnection | None = None
        self._session: MqttSession | None = None
        self._flushing = False
        self._gathering = False
        self._queued = False  # messages were queued for later since the last ``flush_queued``

    def start(self) -> None:
        """Start to connect, on the running loop. Call it once."""
        self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()
        self._work = self._loop.create_task(self._main(), name="cloud")
        self._fallback_reader.start()

    def close(self, timeout: float = 2.0) -> None:
        """Send queued messages for up to ``timeout`` seconds, disconnect without the will, and stop.

        Call it on another thread than the loop's, because it waits for the loop.
        """
        self._patience = timeout
        if self._work is None:
            self._outbox.close()
        elif self._schedule(self._stopping.set):
            self._closed.wait(timeout + 1.0)
        self._fallback_reader.stop()

    def resubscribe(self, subscriptions: Mapping[str, int]) -> None:
        """Replace the filters, now and after reconnects; on the loop.

        Raises ValueError for filters that overlap.
        """
        check_apart(subscriptions)
        self._subscriptions = dict(subscriptions)
        if self._connection is not None:
            self._connection.resubscribe(self._subscriptions)

    def publish(
        self,
        topic: str,
        payload: bytes,
        *,
        qos: int = 0,
        traffic: TrafficClass = TrafficClass.EVENT,
        expiry: float | None = None,
        correlation: bytes | None = None,
        content_type: str | None = None,
        later: bool = False,
    ) -> bool:
        """Queue a message, from any thread, without blocking.

        It is sent now or, if ``later``, at the next flush. ``traffic`` is the class of a message with QoS 1
        or 2: its order and how long it is kept; replies go first. ``expiry`` is the lifetime in seconds; the
        remaining whole seconds are sent to the broker. ``correlation`` and ``content_type`` are sent from QoS
        1 up. Returns False if the message is refused: QoS 0 without a connection, a full queue, a closed
        client. Raises ValueError for a topic with wildcards or a QoS other than 0, 1 and 2.
        """
        if qos not in (0, 1, 2):
            raise ValueError(f"messages are published with QoS 0, 1 or 2, not {qos}")
        if qos:
            message = Outgoing(check_topic(topic), payload, qos, traffic, expiry, correlation, content_type)
            taken = self.spool.put(message)
        else:
            taken = self._outbox.put_qos0(qos0_route(topic, expiry), payload)
        if later:
            self._queued = True
        elif taken:
            self.flush()
        return taken

    def route(self, topic: str, *, qos: int, traffic: TrafficClass, expiry: float | None) -> PublishRoute:
        """Return the publish route of a topic for ``queue``; checked once, for messages many times a second.

        Raises ValueError for a topic with wildcards.
        """
        if not qos:
            return qos0_route(topic, expiry)
        return DurableRoute(check_topic(topic), qos, traffic, expiry)

    def queue(self, route: PublishRoute, payload: bytes) -> None:
        """Queue a message on a route, as ``publish`` does with ``later``."""
        if isinstance(route, DurableRoute):
            self.spool.put(Outgoing(route.topic, payload, route.qos, route.traffic, route.expiry))
            self._queued = True  # last: a concurrent flush must not clear the flag before
        else:
            self._outbox.put_qos0(route, payload)

    def flush_queued(self) -> None:
        """Flush if messages were queued since; from another thread, a flush costs more than a message."""
        if self._queued or self._outbox.waits:
            self._queued = False
            connection = self._connection
            planned = connection is not None and connection.spaced.planned
            if not (planned or self._flushing or self._gathering):
                self._gathering = True
                self._schedule(partial(self._flush_now, spaced=True))

    @property
    def full(self) -> bool:
        """True while QoS 0 messages wait for the network, so that replaceable state is better held back."""
        connection = self._connection
        return connection is not None and connection.full and self._outbox.waits

    def flush(self) -> None:
        """Have the loop write all queued messages; repeated calls are merged into one write."""
        if not self._flushing:
            self._flushing = True
            self._schedule(self._flush_now)

    def _schedule(self, call: Callable[[], object]) -> bool:
        """Schedule a call on the loop; return False before the start and after the end of the loop."""
        if loop := self._loop:
            ours = threading.get_ident() == self._thread
            with contextlib.suppress(RuntimeError):  # closed, perhaps just now
                (loop.call_soon if ours else loop.call_soon_threadsafe)(call)
                return True
        self._flushing = self._gathering = False
        return False

    def _flush_now(self, *, spaced: bool = False) -> None:
        """Write; with ``spaced`` not right after the last write.

        The flag is cleared first, so that a message queued from now on requests the next write.
        """
        if spaced:
            self._gathering = False
        else:
            self._flushing = False
        if connection := self._connection:
            connection.spaced(connection.flush) if spaced else connection.flush()

    async def _main(self) -> None:
        """Stay connected until stopped, then disconnect in order."""
        work = [asyncio.create_task(self._keep_connected()), asyncio.create_task(self._watch())]
        try:
            await self._stopping.wait()
            await self._disconnect()
        finally:
            for task in work:
                task.cancel()
            await asyncio.gather(*work, return_exceptions=True)
            await asyncio.to_thread(self._outbox.close)  # which waits for the disk
            self._set_state(CloudState.CLOSED, "closed")
            self._closed.set()

    async def _disconnect(self) -> None:
        """Wait a limited time for unacknowledged messages, then disconnect."""
        end = self._clock.monotonic() + self._patience * 0.75
        while (connection := self._connection) and connection.busy() and self._clock.monotonic() < end:
            connection.flush()
            await asyncio.sleep(0.01)
        if connection:
            await connection.disconnect(self._patience * 0.25)

    async def _keep_connected(self) -> None:
        """Connect, serve until the connection is lost, wait, and repeat."""
        self._set_state(CloudState.CONNECTING, f"{self._settings.host}:{self._settings.port}")
        while True:
            try:
                state, backoff = CloudState.DISCONNECTED, self._network
                cause = str(await guarded(self._serve))
            except SessionRefused as refusal:
                state, backoff, cause = CloudState.REFUSED, self._refusals, str(refusal)
            except CloudError as error:
                cause = str(error)
            except Exception as error:
                logger.exception("unexpected failure of the cloud connection")
                cause = f"{type(error).__name__}: {error}"
            if self._stopping.is_set():
                return
            self._set_state(state, cause)
            await asyncio.sleep(backoff.wait())

    async def _serve(self) -> CloudError:
        """Run one connection from start to end; return why it ended."""
        session = self._session = MqttSession(self._settings, self._subscriptions, self._outbox, self.stats)
        try:
            async with asyncio.timeout(self._settings.connect_timeout):
                opened = await endpoint.open_socket(self._settings, self._tls)
                self._connection = connection = MqttConnection(
                    opened,
                    session,
                    self._settings,
                    self._clock,
                    deliver=self._deliver,
                    dispatch=self._on_read,
                )
                await connection.wait_ready()
            return await self._serve_ready(connection, session)
        except TimeoutError:
            hint = "" if self._settings.tls else f"; if it wants TLS, {TRY_TLS}"
            return CloudError(f"the broker did not answer within {self._settings.connect_timeout:g} s{hint}")
        finally:  # only the messages to send again outlive a connection
            left, self._connection = self._connection, None
            if left:
                left.give_up(CloudError("given up"))
            session.end()
            self._session = None

    async def _serve_ready(self, connection: MqttConnection, session: MqttSession) -> CloudError:
        """Serve an open connection until it ends; return why, or raise SessionRefused."""
        if connection.ready.done():
            began = self._clock.monotonic()
            self.stats.connects += 1
            self._outbox.go_online()
            asyncio.get_running_loop().call_later(NEWEST_FIRST, self.flush)
            self._set_state(CloudState.CONNECTED, "; ".join(session.problems))
            self._flush_now()
            await asyncio.wait([connection.ended])
            lasted = self._clock.monotonic() - began
            for backoff in (self._network, self._refusals):
                backoff.note(lasted)
        reason = connection.ended.result()
        if isinstance(reason, SessionRefused):
            raise SessionRefused(str(reason))  # a copy: the connection keeps the frames of the original
        return reason

    async def _watch(self) -> None:
        """Periodic work: detect dead links, drop expired messages."""
        while True:
            await asyncio.sleep(self._connection.watch_interval if self._connection else 1.0)
            tried = log_exceptions(logger, "watching the cloud connection failed")
            if self._connection:
                tried(self._connection.watch)()
            if self.state is CloudState.CONNECTED and self._session is not None:  # may refuse filters later
                self._set_state(CloudState.CONNECTED, "; ".join(self._session.problems))
            tried(self._outbox.tick)()
            tried(self._flush_now)()

    def _deliver(self, messages: list[CloudMessage]) -> None:
        """Deliver messages; an error in the callback must not end the connection."""
        try:
            self._on_message(messages)
        except Exception:
            logger.exception("delivering %d messages failed", len(messages))

    def _set_state(self, state: CloudState, cause: str) -> None:
        """Report a change of state, once."""
        if (state, cause) == (self.state, self.cause):
            return
        self.state, self.cause = state, cause
        logger.info("cloud %s: %s", state, cause)
        try:
            self._on_state(state, cause)
        except Exception:
            logger.exception("reporting the state of the cloud connection failed")
