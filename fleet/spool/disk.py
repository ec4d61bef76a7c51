"""The disk thread of a spool: it alone writes, fetches and deletes messages on disk."""

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
from fleet.spool.state_folder import SPOOL, FileLock, create_folder
from fleet.spool.store import SpoolFile
from fleet.wire.rules import TrafficClass

log = logging.getLogger(__name__)

TICK = 0.05
"""Seconds between two writes while connected."""
SYNC = 5.0
"""Seconds between two checkpoints to the medium."""
EXPIRE_EVERY = 30.0
"""Seconds between two searches for expired messages on disk."""
STEPPED = 1.0
"""Smallest step of the wall clock, in seconds, by which the expiry of stored messages is adjusted."""
RETRY = 1.0
"""Seconds until a failed disk is retried."""


class SpoolDisk:
    """The file of a spool and its thread; ``queue_lock`` is the lock of the queue.

    ``size`` bounds the file, bytes; ``ages`` are the lifetimes of messages, seconds. ``more`` is called on
    the thread when messages were fetched. Raises StateTaken when another edge uses the folder. Any other disk
    error is reported in ``problem``, and retried.
    """

    def __init__(
        self,
        folder: Path,
        size: int,
        ages: Mapping[TrafficClass, float],
        *,
        queue: SpoolQueue,
        queue_lock: threading.Lock,
        more: Callable[[], None],
        clock: Clock,
    ) -> None:
        self.problem = ""
        self._path = folder / SPOOL
        self._size = size
        self._ages = ages
        self._queue = queue
        self._queue_lock = queue_lock
        self._more = more
        self._clock = clock
        self._offset = clock.time() - clock.monotonic()
        self._wake = threading.Event()
        self._closing = threading.Event()
        self._store: SpoolFile | None = None
        self._lock: FileLock | None = None
        self._dirty = False
        self._damaged = False  # set the file aside before the next opening
        self._next_sync = self._next_expiry = clock.monotonic()
        try:
            self._lock_folder()
        except StateTaken:
            raise
        except StateError as error:
            log.debug("cannot open the spool yet: %s", error)
        self._open_store()
        self._thread = threading.Thread(target=self._run, name="fleet-spool", daemon=True)
        self._thread.start()

    @property
    def used(self) -> int:
        """Bytes in use of the file, 0 without one."""
        return self._store.used if self._store else 0

    def wake_if_needed(self) -> None:
        """Wake the thread if there is work."""
        if not self._wake.is_set() and self._has_work():
            self._wake.set()

    def close(self) -> None:
        """Write everything, close the file, release the folder; what could not be written is dropped."""
        self._closing.set()
        self._wake.set()
        self._thread.join()
        with self._queue_lock:
            self._queue.close()
        if self._lock is not None:
            self._lock.release()

    def _lock_folder(self) -> None:
        """Create the folder and lock it, unless done; raises StateError, StateTaken."""
        if self._lock is None:
            lock = FileLock(create_folder(self._path.parent) / SPOOL)
            lock.acquire()
            self._lock = lock

    def _open_store(self) -> bool:
        """Open or create the file; on failure return False, and the spool works in memory only."""
        try:
            self._lock_folder()
            if self._damaged:
                with contextlib.suppress(FileNotFoundError):
                    set_aside(self._path)
                self._damaged = False
            self._store = store = SpoolFile(self._path, self._size)
            self._load(store)
        except (StateError, sqlite3.Error, OSError, ValueError) as error:
            self._damaged |= isinstance(error, ValueError)  # a row that no fleet has written
            self._close_store()
            self._report_failure(error)
            with self._queue_lock:
                self._queue.disk.disk_missing()
            self._more()
            return False
        if store.aside is not None:
            self.problem = f"{self._path.name} could not be read and was set aside as {store.aside.name}"
        return True

    def _load(self, store: SpoolFile) -> None:
        """Load the messages and losses of an earlier process."""
        left, losses = store.left(), store.losses()
        with self._queue_lock:
            self._queue.disk.failing = False
            self._queue.losses.add(losses)
            for each in left:
                self._queue.disk.found(each.topic, each.traffic, each.count, each.oldest, each.newest)
        if self._queue.waiting:
            log.info("%d messages are left from an earlier run", self._queue.waiting)

    def _close_store(self) -> None:
        """Close the file, if it is open."""
        if self._store is not None:
            self._store.close()
            self._store = None

    def _has_work(self) -> bool:
        """Return whether there is work."""
        return self._queue.disk.unwritten or self._queue.disk.needs_fetch

    def _run(self) -> None:
        """Run the thread."""
        while not self._closing.is_set():
            self._wake.wait(RETRY if self._store is None else EXPIRE_EVERY)
            self._wake.clear()
            if self._queue.online and not self._queue.disk.needs_fetch:
                self._closing.wait(TICK)
            if not self._step():
                self._closing.wait(RETRY)
            if self._has_work():
                self._wake.set()
        while self._has_work() and self._step():
            pass
        self._close_store()

    def _step(self) -> bool:
        """Do all due work on the disk; return False if it failed."""
        if self._store is None:
            return self._open_store()
        succeeded = True
        for work in (self._follow_clock, self._expire, self._write, self._fetch, self._sync):
            try:
                work(self._store)
            except Exception as error:  # noqa: BLE001 - go on: a full disk can still be read
                succeeded = False
                self._report_failure(error)
                if isinstance(error, sqlite3.Error) and is_corrupt(error):
                    self._abandon()
                    break
        return succeeded

    def _follow_clock(self, store: SpoolFile) -> None:
        """Adjust expiries to a step of the wall clock, as after a start without network time."""
        stepped = self._clock.time() - self._clock.monotonic() - self._offset
        if abs(stepped) >= STEPPED:
            store.postpone(stepped, after=self._queue.disk.before)
            self._offset += stepped
            log.info("the clock was set by %.0f s: stored messages keep their age", stepped)

    def _write(self, store: SpoolFile) -> None:
        """Write and delete the due messages, after making room."""
        with self._queue_lock:
            work = self._queue.disk.work(self._clock.monotonic())
            losses = self._queue.losses.known() if self._queue.losses.changed else None
            self._queue.losses.changed = False
        if not (work.rows or work.done or losses is not None):
            return
        for message in work.rows:
            assert message.deadline is not None  # set by the queue
            message.expires = message.deadline + self._offset
        try:
            self._change(store, work, losses)
        except Exception:
            with self._queue_lock:
                self._queue.disk.not_written(work)
                self._queue.losses.changed = True
            raise
        with self._queue_lock:
            self._queue.disk.wrote(work)
        self._dirty = True
        if self.problem:
            log.info("the spool can be written again")
            self.problem = ""

    def _change(self, store: SpoolFile, work: DiskWork, losses: list[Gap] | None) -> None:
        """Change the file within its budget."""
        size = sum(len(message.payload) + 100 for message in work.rows)
        if work.rows and not store.room(size):
            for removed in store.evict(size):
                self._report_removed(removed, Reason.ROOM)
        store.change(work.rows, work.done, losses)

    def _fetch(self, store: SpoolFile) -> None:
        """Fetch messages that will be sent soon."""
        with self._queue_lock:
            fetches = self._queue.disk.fetches()
        for fetch in fetches:
            messages = store.fetch(fetch.topic, fetch.after, fetch.limit, fetch.traffic)
            now, wall = self._clock.monotonic(), self._clock.time()
            longest = self._ages
            for message in messages:
                left = min(message.expires - wall, longest[message.traffic])
                message.since, message.deadline = now, now + left
            with self._queue_lock:
                self._queue.disk.fetched(fetch.topic, messages, more=len(messages) == fetch.limit)
        if fetches:
            self._more()

    def _expire(self, store: SpoolFile) -> None:
        """Periodically delete expired messages."""
        now = self._clock.monotonic()
        if now >= self._next_expiry:
            self._next_expiry = now + EXPIRE_EVERY
            self._report_removed(store.expire(self._clock.time()), Reason.AGE)

    def _sync(self, store: SpoolFile) -> None:
        """Periodically write the WAL to the medium."""
        now = self._clock.monotonic()
        if self._dirty and now >= self._next_sync:
            self._next_sync, self._dirty = now + SYNC, False
            store.checkpoint()

    def _report_removed(self, removed: Iterable[tuple[str, int]], reason: Reason) -> None:
        """Report messages removed from disk to the queue."""
        by_topic: dict[str, list[int]] = defaultdict(list)
        for topic, seq in removed:
            by_topic[topic].append(seq)
        with self._queue_lock:
            for topic, seqs in by_topic.items():
                self._queue.disk.removed(topic, seqs, reason, self._clock.time())

    def _abandon(self) -> None:
        """Give up a damaged file, to be set aside; messages in memory will go to a new one."""
        self._close_store()
        self._damaged = True
        with self._queue_lock:
            self._queue.disk.lost_disk(self._clock.time())

    def _report_failure(self, error: Exception) -> None:
        """Log and record that messages are kept in memory only."""
        problem = f"the spool cannot be written: {error}"
        if problem != self.problem:
            log.error("%s; messages are kept in memory only", problem)
        self.problem = problem
