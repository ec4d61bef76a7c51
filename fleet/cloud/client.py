"""The connection to the cloud: keeps a session alive and hands messages over.

It lives on the event loop: a command is read, and obeyed, without waiting for another thread. A thread stands
by that reads, and pings, while the loop is stuck.
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
from fleet.cloud.publish import PublishRoute, publish_route
from fleet.cloud.reconnect_backoff import Backoff
from fleet.cloud.topics import check_apart, check_topic
from fleet.cloud.values import CloudMessage, CloudSettings, CloudState, CloudStats
from fleet.errors import CloudError
from fleet.spool.message import Outgoing
from fleet.spool.queue import NEWEST_FIRST
from fleet.spool.spool import Spool, SpoolSettings
from fleet.wire.rules import TrafficClass

logger = logging.getLogger(__name__)


class DurableRoute(msgspec.Struct, frozen=True):
    """The way of durable messages: topic, QoS, how much they matter, for how many seconds they are kept."""

    topic: str
    qos: int
    traffic: TrafficClass
    expiry: float | None


Way = PublishRoute | DurableRoute


class CloudClient:
    """An MQTT client that reconnects by itself and never blocks who publishes.

    ``subscriptions`` maps filters to QoS; they are asked for again after every reconnect.
    What the client publishes does not come back to it (MQTT 5; 3.1.1 cannot ask for that).
    ``on_message`` gets everything that one read brought, in order, and must only hand over: it runs on the
    loop, or on the thread that stands by while the loop is stuck, and nothing else is read meanwhile. After
    it the loop calls ``on_read``. The other callbacks run on the loop.
    ``spool`` keeps what is durable (left out: one in memory alone); it is closed with the client.
    Raises ValueError for filters that overlap, CloudError for settings that are not safe or not usable.
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
        self._fallback_reader = FallbackReader(lambda: bool((one := self._connection) and one.stand_in()))
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread = 0  # the loop's
        self._work: asyncio.Task[None] | None = None
        self._stopping = asyncio.Event()
        self._closed = threading.Event()
        self._patience = 0.0
        self._connection: MqttConnection | None = None
        self._session: MqttSession | None = None
        self._flushing = False
        self._gathering = False
        self._queued = False  # something was, for later, since the last ``flush_queued``

    def start(self) -> None:
        """Begin to connect, on the loop that runs. A client is started once."""
        self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()
        self._work = self._loop.create_task(self._main(), name="cloud")
        self._fallback_reader.start()

    def close(self, timeout: float = 2.0) -> None:
        """Send what waits, as far as ``timeout`` seconds allow, say goodbye (no will) and end.

        On another thread than the loop's, which does it meanwhile.
        """
        self._patience = timeout
        if self._work is None:
            self._outbox.close()
        elif self._soon(self._stopping.set):
            self._closed.wait(timeout + 1.0)
        self._fallback_reader.stop()

    def resubscribe(self, subscriptions: Mapping[str, int]) -> None:
        """Subscribe to other filters from now on, after reconnects too; on the loop.

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
        """Queue a message; from any thread, never blocking. It leaves at once, or ``later``: on a flush.

        ``traffic`` says how much a message of QoS 1 matters, and so when it goes and how long it is kept;
        replies go before all that waits. ``expiry`` is how many seconds it is worth sending; what is left of
        them goes to the broker in whole seconds. ``correlation`` and ``content_type`` go along from QoS 1 up.
        Returns False when it is not taken: QoS 0 without a connection, a full queue, a closed client.
        Raises ValueError for a topic with wildcards or a QoS other than 0, 1 and 2.
        """
        if qos not in (0, 1, 2):
            raise ValueError(f"messages are published with QoS 0, 1 or 2, not {qos}")
        if qos:
            message = Outgoing(check_topic(topic), payload, qos, traffic, expiry, correlation, content_type)
            taken = self.spool.put(message)
        else:
            taken = self._outbox.put_light(publish_route(topic, expiry), payload)
        if later:
            self._queued = True
        elif taken:
            self.flush()
        return taken

    def way(self, topic: str, *, qos: int, traffic: TrafficClass, expiry: float | None) -> Way:
        """Return the way to a topic, for ``queue``: what is said many times a second is looked at once.

        Raises ValueError for a topic with wildcards.
        """
        if not qos:
            return publish_route(topic, expiry)
        return DurableRoute(check_topic(topic), qos, traffic, expiry)

    def queue(self, way: Way, payload: bytes) -> None:
        """Do as ``publish``, ``later``."""
        if isinstance(way, DurableRoute):
            self.spool.put(Outgoing(way.topic, payload, way.qos, way.traffic, way.expiry))
            self._queued = True  # last: another thread's flush in between must not take the mark away
        else:
            self._outbox.put_light(way, payload)

    def flush_queued(self) -> None:
        """Flush, if something was queued since; from another thread that costs more than a message."""
        if self._queued or self._outbox.waits:
            self._queued = False
            connection = self._connection
            planned = connection is not None and connection.spaced.planned
            if not (planned or self._flushing or self._gathering):
                self._gathering = True
                self._soon(partial(self._flush_now, spaced=True))

    @property
    def full(self) -> bool:
        """True while the network has not taken QoS 0 of before: what has a newer one soon had better wait."""
        connection = self._connection
        return connection is not None and connection.full and self._outbox.waits

    def flush(self) -> None:
        """Have the loop write everything that waits; asked for many times, it does so once."""
        if not self._flushing:
            self._flushing = True
            self._soon(self._flush_now)

    def _soon(self, call: Callable[[], object]) -> bool:
        """Have the loop make a call; False before the start and after the loop's end."""
        if loop := self._loop:
            ours = threading.get_ident() == self._thread
            with contextlib.suppress(RuntimeError):  # closed, perhaps just now
                (loop.call_soon if ours else loop.call_soon_threadsafe)(call)
                return True
        self._flushing = self._gathering = False
        return False

    def _flush_now(self, *, spaced: bool = False) -> None:
        """Write; with ``spaced`` not right after the last write.

        The mark falls first, so that a message queued from now on asks for the next write.
        """
        if spaced:
            self._gathering = False
        else:
            self._flushing = False
        if connection := self._connection:
            connection.spaced(connection.flush) if spaced else connection.flush()

    async def _main(self) -> None:
        """Keep connected until told to stop, then leave in an orderly way."""
        work = [asyncio.create_task(self._keep_connected()), asyncio.create_task(self._watch())]
        try:
            await self._stopping.wait()
            await self._leave()
        finally:
            for task in work:
                task.cancel()
            await asyncio.gather(*work, return_exceptions=True)
            await asyncio.to_thread(self._outbox.close)  # which waits for the disk
            self._set_state(CloudState.CLOSED, "closed")
            self._closed.set()

    async def _leave(self) -> None:
        """Wait a little for what is under way, then say goodbye."""
        end = self._clock.monotonic() + self._patience * 0.75
        while (connection := self._connection) and connection.busy() and self._clock.monotonic() < end:
            connection.flush()
            await asyncio.sleep(0.01)
        if connection:
            await connection.leave(self._patience * 0.25)

    async def _keep_connected(self) -> None:
        """Connect, serve until the connection falls, wait, and begin again."""
        self._set_state(CloudState.CONNECTING, f"{self._settings.host}:{self._settings.port}")
        while True:
            try:
                state, backoff = CloudState.DISCONNECTED, self._network
                cause = str(await self._serve())
            except SessionRefused as refusal:
                state, backoff, cause = CloudState.REFUSED, self._refusals, str(refusal)
            except CloudError as error:
                cause = str(error)
            except Exception as error:
                logger.exception("the cloud connection failed in a way that was not foreseen")
                cause = f"{type(error).__name__}: {error}"
            if self._stopping.is_set():
                return
            self._set_state(state, cause)
            await asyncio.sleep(backoff.wait())

    async def _serve(self) -> CloudError:
        """Carry one connection from its beginning to its end; return why it ended."""
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
                    take=self._on_read,
                )
                await connection.answered()
            return await self._serve_ready(connection, session)
        except TimeoutError:
            hint = "" if self._settings.tls else f"; if it wants TLS, {TRY_TLS}"
            return CloudError(f"the broker did not answer within {self._settings.connect_timeout:g} s{hint}")
        finally:  # nothing of a connection is left but the messages that must be sent again
            left, self._connection = self._connection, None
            if left:
                left.give_up(CloudError("given up"))
            session.end()
            self._session = None

    async def _serve_ready(self, connection: MqttConnection, session: MqttSession) -> CloudError:
        """Be connected until the connection ends; return why, or raise SessionRefused."""
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
            raise SessionRefused(str(reason))  # another one, whose frames the connection does not keep
        return reason

    async def _watch(self) -> None:
        """Look after time: dead links, messages that are no longer worth sending."""
        while True:
            await asyncio.sleep(self._connection.patience if self._connection else 1.0)
            if self._connection:
                self._connection.watch()
            if self.state is CloudState.CONNECTED and self._session is not None:  # a broker may refuse later
                self._set_state(CloudState.CONNECTED, "; ".join(self._session.problems))
            self._outbox.tick()
            self._flush_now()

    def _deliver(self, messages: list[CloudMessage]) -> None:
        """Hand messages over; an error there must not end the connection."""
        try:
            self._on_message(messages)
        except Exception:
            logger.exception("handing over %d messages failed", len(messages))

    def _set_state(self, state: CloudState, cause: str) -> None:
        """Tell of a change, once."""
        if (state, cause) == (self.state, self.cause):
            return
        self.state, self.cause = state, cause
        logger.info("cloud %s: %s", state, cause)
        try:
            self._on_state(state, cause)
        except Exception:
            logger.exception("telling the cloud's state failed")
