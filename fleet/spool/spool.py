"""The spool of one edge: the queue's decisions, carried out by a thread that alone touches the disk.

Nobody who publishes or sends waits for the disk. What a killed process loses of what it has taken is what
the disk had not got yet: while disconnected what came since the last commit (a few milliseconds), while
connected what the cloud has not acknowledged and that is younger than GRACE and TICK together. A power cut
may in addition lose the commits of the last SYNC seconds.
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
from fleet.spool.message import Outcome, Outgoing
from fleet.spool.queue import SpoolQueue
from fleet.spool.statistics import SpoolStatistics
from fleet.wire.rules import TrafficClass

AGES: Mapping[TrafficClass, float] = MappingProxyType(
    {TrafficClass.REPLY: 60.0, TrafficClass.STATUS: 86400.0, TrafficClass.EVENT: 86400.0}
)
"""Seconds that messages are worth sending."""


class SpoolSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Bounds of a spool: ``folder`` None keeps nothing on disk; ``size`` bytes of disk, ``ages`` seconds.

    ``messages`` and ``memory`` (bytes) bound what stands in memory.
    """

    folder: Path | None = None
    size: int = 256 * 1024 * 1024
    ages: Mapping[TrafficClass, float] = AGES
    messages: int = 5_000
    memory: int = 8 * 1024 * 1024


class Spool:
    """Durable messages on their way out; every method may be called from any thread and none blocks for long.

    Raises StateTaken when another edge has the folder. A disk that fails, now or later, is told in
    ``problem`` and tried again, and what waits is then bounded by memory. ``more`` is called, on the disk's
    thread, when there is more to take.
    """

    def __init__(self, settings: SpoolSettings, clock: Clock) -> None:
        self._clock = clock
        self._queue = SpoolQueue(
            settings.messages,
            settings.memory,
            settings.ages,
            disk=settings.folder is not None,
            first=int(clock.time() * 1e6),  # later than all that an earlier process numbered
        )
        self.more: Callable[[], None] = lambda: None
        self._using = threading.Lock()
        self._closed = False
        self._disk: SpoolDisk | None = None
        if settings.folder is not None:
            self._disk = SpoolDisk(
                settings.folder,
                settings.size,
                settings.ages,
                queue=self._queue,
                using=self._using,
                more=self._tell_more,
                clock=clock,
            )

    def put(self, message: Outgoing) -> bool:
        """Take a message of QoS 1; False when it cannot be kept at all."""
        with self._using:
            taken = not self._closed and self._queue.put(message, self._clock.monotonic(), self._clock.time())
        self._wake_disk()
        return taken

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return what may be written next."""
        with self._using:
            batch = self._queue.take(now, window=window, reserve=reserve, size=size)
        if self._queue.disk.needs_fetch:
            self._wake_disk()
        return batch

    def settle(self, answers: Iterable[tuple[Outgoing, Outcome]]) -> None:
        """Take what the broker said of messages that were taken."""
        now, wall = self._clock.monotonic(), self._clock.time()
        with self._using:
            for message, outcome in answers:
                self._queue.settle(message, outcome, now, wall)
        self._wake_disk()

    def put_back(self, messages: Iterable[Outgoing]) -> None:
        """Take back messages, oldest first, that were under way when the connection ended."""
        with self._using:
            self._queue.put_back(messages)

    def go_online(self) -> None:
        """Begin a new connection."""
        with self._using:
            self._queue.go_online(self._clock.monotonic())
        self._wake_disk()

    def go_offline(self) -> None:
        """Note the end of the connection: from now on everything goes to disk at once."""
        with self._using:
            self._queue.go_offline()
        self._wake_disk()

    def tick(self) -> None:
        """Look after time: once a second or so."""
        with self._using:
            self._queue.tick(self._clock.monotonic(), self._clock.time())
        self._wake_disk()

    def take_gaps(self) -> list[Gap]:
        """Remove and return the losses, for whoever tells them now."""
        with self._using:
            gaps = self._queue.losses.take()
        self._wake_disk()
        return gaps

    @property
    def problem(self) -> str:
        """What is wrong with the disk; empty: nothing."""
        return self._disk.problem if self._disk is not None else ""

    @property
    def waiting(self) -> int:
        """How many messages wait."""
        return self._queue.waiting

    @property
    def unheard(self) -> int:
        """How many of them wait for somebody to hear their topics, and not for the cloud."""
        with self._using:
            return self._queue.unheard

    @property
    def lost(self) -> int:
        """How many messages were lost since the start."""
        return self._queue.losses.total

    @property
    def idle(self) -> bool:
        """True when nothing could be sent now."""
        return self._queue.idle

    def figures(self) -> SpoolStatistics:
        """Return how the spool stands."""
        with self._using:
            queue, disk = self._queue, self._disk
            lost = dict(queue.losses.counts)
            return SpoolStatistics(queue.standing(), lost, queue.held, disk.used if disk else 0, self.problem)

    def close(self) -> None:
        """Write everything and let go of the file; what is not on disk then is dropped."""
        with self._using:
            self._closed = True
            self._queue.go_offline()
        if self._disk is not None:
            self._disk.close()
        else:
            self._queue.close()

    def _wake_disk(self) -> None:
        """Have the disk's thread do what there is to do."""
        if self._disk is not None:
            self._disk.wake_if_needed()

    def _tell_more(self) -> None:
        """Tell whoever takes, who is known later than the disk, that there is more."""
        self.more()
