"""The thread of a spool that alone touches the disk: what waits is written, fetched and removed there."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from fleet.clock import Clock
from fleet.errors import StateError, StateTaken
from fleet.spool.database import is_corrupt, set_aside
from fleet.spool.disk_work import DiskWork
from fleet.spool.losses import Gap, Reason
from fleet.spool.queue import SpoolQueue
from fleet.spool.state_folder import SPOOL, FileLock, made
from fleet.spool.store import SpoolFile
from fleet.wire.rules import TrafficClass

log = logging.getLogger(__name__)

TICK = 0.05
"""Seconds between two looks at what has to go to disk, while connected."""
SYNC = 5.0
"""Seconds between two times that the medium itself is brought up to date."""
LATE_LOOK = 30.0
"""Seconds between two looks for what is too old on disk."""
STEPPED = 1.0
"""Seconds by which the wall clock must be set for what is on disk to follow it."""
RETRY = 1.0
"""Seconds after which a disk that failed is tried again."""


class SpoolDisk:
    """The file of a spool and the thread that has it; ``using`` guards the queue, which others use too.

    ``size`` bounds the file, bytes; ``ages`` are the seconds that messages are worth sending. ``more`` is
    called on the thread when there is more to take. Raises StateTaken when another edge has the folder.
    What else is wrong with the disk is told in ``problem``, and tried again.
    """

    def __init__(
        self,
        folder: Path,
        size: int,
        ages: Mapping[TrafficClass, float],
        *,
        queue: SpoolQueue,
        using: threading.Lock,
        more: Callable[[], None],
        clock: Clock,
    ) -> None:
        self.problem = ""
        self._path = folder / SPOOL
        self._size = size
        self._ages = ages
        self._queue = queue
        self._using = using
        self._more = more
        self._clock = clock
        self._offset = clock.time() - clock.monotonic()
        self._wake = threading.Event()
        self._closing = threading.Event()
        self._store: SpoolFile | None = None
        self._lock: FileLock | None = None
        self._dirty = False
        self._damaged = False  # the file is never opened again, but set aside first
        self._next_sync = self._next_look = clock.monotonic()
        try:
            self._have()
        except StateTaken:
            raise
        except StateError as error:
            log.debug("opening the store tells this: %s", error)
        self._open_store()
        self._thread = threading.Thread(target=self._run, name="fleet-spool", daemon=True)
        self._thread.start()

    @property
    def used(self) -> int:
        """Bytes of the file, 0 while there is none."""
        return self._store.used if self._store else 0

    def wake_if_needed(self) -> None:
        """Wake the thread where there is something for it to do."""
        if not self._wake.is_set() and self._wanted():
            self._wake.set()

    def close(self) -> None:
        """Write everything, close the file and let go of the folder; what is not on disk then is dropped."""
        self._closing.set()
        self._wake.set()
        self._thread.join()
        with self._using:
            self._queue.close()
        if self._lock is not None:
            self._lock.let_go()

    def _have(self) -> None:
        """Make the folder and take its lock, unless that is done; raises StateError, StateTaken."""
        if self._lock is None:
            lock = FileLock(made(self._path.parent) / SPOOL)
            lock.take()
            self._lock = lock

    def _open_store(self) -> bool:
        """Open the file, or make it anew; while that fails return False, and memory alone serves."""
        try:
            self._have()
            if self._damaged:
                with contextlib.suppress(FileNotFoundError):
                    set_aside(self._path)
                self._damaged = False
            self._store = store = SpoolFile(self._path, self._size)
            self._take_over(store)
        except (StateError, sqlite3.Error, OSError) as error:
            self._close_store()
            self._fail(error)
            with self._using:
                self._queue.disk.no_disk()
            self._more()
            return False
        if store.aside is not None:
            self.problem = f"{self._path.name} could not be read and was set aside as {store.aside.name}"
        return True

    def _take_over(self, store: SpoolFile) -> None:
        """Take over what an earlier process left."""
        left, losses = store.left(), store.losses()
        with self._using:
            self._queue.disk.failing = False
            self._queue.losses.add(losses)
            for each in left:
                self._queue.disk.found(each.topic, each.traffic, each.count, each.oldest, each.newest)
        if self._queue.waiting:
            log.info("%d messages wait from before", self._queue.waiting)

    def _close_store(self) -> None:
        """Close the file, if it is open."""
        if self._store is not None:
            self._store.close()
            self._store = None

    def _wanted(self) -> bool:
        """Tell whether there is something to do."""
        return self._queue.disk.unwritten or self._queue.disk.needs_fetch

    def _run(self) -> None:
        """Be the thread."""
        while not self._closing.is_set():
            self._wake.wait(LATE_LOOK)
            self._wake.clear()
            if self._queue.online and not self._queue.disk.needs_fetch:
                self._closing.wait(TICK)
            if not self._step():
                self._closing.wait(RETRY)
            if self._wanted():
                self._wake.set()
        while self._wanted() and self._step():
            pass
        self._close_store()

    def _step(self) -> bool:
        """Bring the disk up to date; return False when it failed."""
        if self._store is None:
            return self._open_store()
        fine = True
        for work in (self._follow_clock, self._expire, self._write, self._fetch, self._sync):
            try:
                work(self._store)
            except sqlite3.Error as error:  # a disk that is full can still be read
                fine = False
                self._fail(error)
                if is_corrupt(error):
                    self._abandon()
                    break
        return fine

    def _follow_clock(self, store: SpoolFile) -> None:
        """Have what this process wrote keep its age when the wall clock is set, as after a start offline."""
        stepped = self._clock.time() - self._clock.monotonic() - self._offset
        if abs(stepped) >= STEPPED:
            store.postpone(stepped, after=self._queue.disk.before)
            self._offset += stepped
            log.info("the clock was set by %.0f s: what waits keeps its age", stepped)

    def _write(self, store: SpoolFile) -> None:
        """Write what is due, after making room for it."""
        with self._using:
            work = self._queue.disk.work(self._clock.monotonic())
            losses = self._queue.losses.known() if self._queue.losses.changed else None
            self._queue.losses.changed = False
        if not (work.rows or work.done or losses is not None):
            return
        for message in work.rows:
            assert message.deadline is not None  # the queue has given it
            message.expires = message.deadline + self._offset
        try:
            self._change(store, work, losses)
        except sqlite3.Error:
            with self._using:
                self._queue.disk.not_written(work)
                self._queue.losses.changed = True
            raise
        with self._using:
            self._queue.disk.wrote(work)
        self._dirty = True
        if self.problem:
            log.info("the spool is written again")
            self.problem = ""

    def _change(self, store: SpoolFile, work: DiskWork, losses: list[Gap] | None) -> None:
        """Change the file, within its budget."""
        size = sum(len(message.payload) + 100 for message in work.rows)
        if work.rows and not store.room(size):
            for removed in store.evict(size):
                self._tell_removed(removed, Reason.ROOM)
        store.change(work.rows, work.done, losses)

    def _fetch(self, store: SpoolFile) -> None:
        """Bring back what will soon be sent."""
        with self._using:
            fetches = self._queue.disk.fetches()
        for fetch in fetches:
            messages = store.fetch(fetch.topic, fetch.after, fetch.limit, fetch.traffic)
            now, wall = self._clock.monotonic(), self._clock.time()
            longest = self._ages
            for message in messages:
                left = min(message.expires - wall, longest[message.traffic])
                message.since, message.deadline = now, now + left
            with self._using:
                self._queue.disk.fetched(fetch.topic, messages, more=len(messages) == fetch.limit)
        if fetches:
            self._more()

    def _expire(self, store: SpoolFile) -> None:
        """Remove what is too old, now and then."""
        now = self._clock.monotonic()
        if now >= self._next_look:
            self._next_look = now + LATE_LOOK
            self._tell_removed(store.expire(self._clock.time()), Reason.AGE)

    def _sync(self, store: SpoolFile) -> None:
        """Bring the medium itself up to date, now and then."""
        now = self._clock.monotonic()
        if self._dirty and now >= self._next_sync:
            self._next_sync, self._dirty = now + SYNC, False
            store.checkpoint()

    def _tell_removed(self, removed: Iterable[tuple[str, int]], reason: Reason) -> None:
        """Tell the queue what is not on disk any more."""
        by_topic: dict[str, list[int]] = defaultdict(list)
        for topic, seq in removed:
            by_topic[topic].append(seq)
        with self._using:
            for topic, seqs in by_topic.items():
                self._queue.disk.removed(topic, seqs, reason, self._clock.time())

    def _abandon(self) -> None:
        """Leave a file that is damaged, to be set aside; what is in memory goes to a new one."""
        self._close_store()
        self._damaged = True
        with self._using:
            self._queue.disk.lost_disk(self._clock.time())

    def _fail(self, error: Exception) -> None:
        """Tell that what waits is kept in memory alone."""
        problem = f"the spool cannot be written: {error}"
        if problem != self.problem:
            log.error("%s; what waits is kept in memory alone", problem)
        self.problem = problem
