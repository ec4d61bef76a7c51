"""The spool of one edge: the decisions are made by the queue, and carried out on disk by one thread.

Publishing and sending never wait for the disk. If the process is killed, the messages that are not on disk
yet are lost: while disconnected, those since the last commit (a few milliseconds); while connected, the
unacknowledged ones that are younger than GRACE and TICK together. A power cut may also lose the commits of
the last SYNC seconds.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

import msgspec

from fleet.clock import Clock
from fleet.spool.disk import SpoolDisk
from fleet.spool.losses import Gap
from fleet.spool.message import DeliveryOutcome, Outgoing
from fleet.spool.queue import SpoolQueue
from fleet.spool.statistics import SpoolStatistics
from fleet.wire.rules import TrafficClass

AGES: Mapping[TrafficClass, float] = MappingProxyType(
    {TrafficClass.REPLY: 60.0, TrafficClass.STATUS: 86400.0, TrafficClass.EVENT: 86400.0}
)
"""Lifetimes of messages in seconds."""


class SpoolSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Bounds of a spool: ``size`` in bytes of disk, ``ages`` in seconds; no ``folder``: memory only.

    ``messages`` and ``memory`` (bytes) bound the messages in memory.
    """

    folder: Path | None = None
    size: int = 256 * 1024 * 1024
    ages: Mapping[TrafficClass, float] = AGES
    messages: int = 5_000
    memory: int = 8 * 1024 * 1024


class Spool:
    """Queue of durable outbound messages; all methods are thread-safe, and none blocks for long.

    Raises StateTaken when another edge uses the folder. A disk that fails, now or later, is reported in
    ``problem`` and retried; meanwhile the bound on memory applies to all messages. ``more`` is called, on the
    disk thread, when messages were fetched.
    """

    def __init__(self, settings: SpoolSettings, clock: Clock) -> None:
        self._clock = clock
        self._queue = SpoolQueue(
            settings.messages,
            settings.memory,
            settings.ages,
            disk=settings.folder is not None,
            first=int(clock.time() * 1e6),  # above all numbers of earlier processes
        )
        self.more: Callable[[], None] = lambda: None
        self._queue_lock = threading.Lock()
        self._closed = False
        self._disk: SpoolDisk | None = None
        if settings.folder is not None:
            self._disk = SpoolDisk(
                settings.folder,
                settings.size,
                settings.ages,
                queue=self._queue,
                queue_lock=self._queue_lock,
                more=self._call_more,
                clock=clock,
            )

    def put(self, message: Outgoing) -> bool:
        """Queue a message of QoS 1 or 2; return False if it cannot be kept at all."""
        with self._queue_lock:
            taken = not self._closed and self._queue.put(message, self._clock.monotonic(), self._clock.time())
        self._wake_disk()
        return taken

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return the next messages to send."""
        with self._queue_lock:
            batch = self._queue.take(now, window=window, reserve=reserve, size=size)
        if self._queue.disk.needs_fetch:
            self._wake_disk()
        return batch

    def settle(self, answers: Iterable[tuple[Outgoing, DeliveryOutcome]]) -> None:
        """Apply the broker's acknowledgements of in-flight messages."""
        now, wall = self._clock.monotonic(), self._clock.time()
        with self._queue_lock:
            for message, outcome in answers:
                self._queue.settle(message, outcome, now, wall)
        self._wake_disk()

    def requeue(self, messages: Iterable[Outgoing]) -> None:
        """Take back the messages, oldest first, that were in flight when the connection ended."""
        with self._queue_lock:
            self._queue.requeue(messages)

    def go_online(self) -> None:
        """Start a new connection."""
        with self._queue_lock:
            self._queue.go_online(self._clock.monotonic())
        self._wake_disk()

    def go_offline(self) -> None:
        """Record the end of the connection: from now on every message goes to disk immediately."""
        with self._queue_lock:
            self._queue.go_offline()
        self._wake_disk()

    def tick(self) -> None:
        """Expire messages and retry held topics; about once a second."""
        with self._queue_lock:
            self._queue.tick(self._clock.monotonic(), self._clock.time())
        self._wake_disk()

    def take_gaps(self) -> list[Gap]:
        """Remove and return the losses; the caller reports them."""
        with self._queue_lock:
            gaps = self._queue.losses.take()
        self._wake_disk()
        return gaps

    @property
    def problem(self) -> str:
        """What is wrong with the disk; empty if nothing."""
        return self._disk.problem if self._disk is not None else ""

    @property
    def waiting(self) -> int:
        """The number of waiting messages."""
        return self._queue.waiting

    @property
    def unsubscribed(self) -> int:
        """The number of messages that wait for a subscriber of their topic, not for the cloud."""
        with self._queue_lock:
            return self._queue.unsubscribed

    @property
    def lost(self) -> int:
        """The number of messages lost since the start."""
        return self._queue.losses.total

    @property
    def idle(self) -> bool:
        """True when there is nothing to send now."""
        return self._queue.idle

    def figures(self) -> SpoolStatistics:
        """Return the statistics."""
        with self._queue_lock:
            queue, disk = self._queue, self._disk
            lost = dict(queue.losses.counts)
            return SpoolStatistics(
                queue.statistics(), lost, queue.held, disk.used if disk else 0, self.problem
            )

    def close(self) -> None:
        """Write everything and release the file; messages that are not on disk are dropped."""
        with self._queue_lock:
            self._closed = True
            self._queue.go_offline()
        if self._disk is not None:
            self._disk.close()
        else:
            self._queue.close()

    def _wake_disk(self) -> None:
        """Wake the disk thread if it has work."""
        if self._disk is not None:
            self._disk.wake_if_needed()

    def _call_more(self) -> None:
        """Call ``more``, which is set after the disk thread has started."""
        self.more()
