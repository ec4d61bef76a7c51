"""Event store of an edge: a bounded SQLite file beside the journal, written by the journal's thread.

``add`` takes an event from any thread and only appends it to a queue in memory; ``write``, which the
journal's thread calls periodically, writes the whole queue in one commit. Processes of one edge on the same
computer share the file.

==========================  ==========================================================================
condition                   reaction of the store
==========================  ==========================================================================
disk full, read-only        keeps the newest events in memory, sets ``problem``, retries
too many events wait        drops the oldest, and records their number once the file can be written
file damaged                sets it aside and creates a new one
file of a newer fleet       the same; that fleet can use it again
file locked by a process    as with a full disk; the journal's thread waits only a moment
file too old or too large   deletes the oldest events, a few at a time
==========================  ==========================================================================
"""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections import deque
from collections.abc import Callable
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.errors import StateError, StateTaken
from fleet.history.record import COLUMNS, Record, RecordRow, record_of, row_of
from fleet.model.event import EventKind, EventReport, Severity
from fleet.spool.database import PAGE, is_corrupt, open_checked, transaction
from fleet.spool.state_folder import create_folder, locked

log = logging.getLogger(__name__)

HISTORY = "history.db"
FORMATS = (
    """
CREATE TABLE event (
    id INTEGER PRIMARY KEY, stamp REAL, robot TEXT, kind TEXT, severity TEXT, text TEXT,
    way TEXT, asker TEXT, source_type TEXT, proven INTEGER, command TEXT, request TEXT, data TEXT
);
CREATE INDEX event_by_stamp ON event (stamp);
CREATE INDEX event_by_robot ON event (robot, stamp);
""",
)
"""SQL that creates the file, and migrates it from each format number to the next."""
WAITING = 5000  # maximum number of events in memory
RETRY_AFTER = 5.0  # s until the next attempt after a failed write
BUSY = 0.2
"""Seconds to wait for another process that opens or writes; it also delays the record of a stop."""
LAST_LOCK_TIMEOUT = 2.0  # s to wait for the lock in the last write of the process
PRUNE_EVERY = 60.0  # s
AT_ONCE = 1000  # rows deleted in one commit
NEWEST = 1000
"""Newest events, kept whatever their stamps: a computer without a clock may start in 1970."""
_ADD = f"INSERT INTO event ({COLUMNS}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"  # noqa: S608 - columns of ours
_TOO_OLD = (
    "DELETE FROM event WHERE id IN (SELECT id FROM event WHERE stamp < ? "
    "AND id <= (SELECT max(id) FROM event) - ? LIMIT ?)"
)
_OLDEST = "DELETE FROM event WHERE id IN (SELECT id FROM event ORDER BY id LIMIT ?)"


class HistoryBounds(msgspec.Struct, frozen=True):
    """Retention limits: ``size`` in bytes on disk, ``age`` in seconds."""

    size: int = 64 << 20
    age: float = 90 * 86400.0


class History:
    """Event store of one process. ``problem`` says why events are not on disk; empty while they are.

    ``on_event`` is called with each event and its robot, on the thread that added it: it must not wait.
    """

    def __init__(self, folder: Path, clock: Clock, bounds: HistoryBounds | None = None) -> None:
        self.problem = ""
        self.on_event: Callable[[str, EventReport], None] = lambda _robot, _event: None
        self.folder = folder
        self._clock = clock
        self._bounds = bounds or HistoryBounds()
        self._waiting: deque[RecordRow] = deque()
        self._lost = 0
        self._lock_timeout = BUSY
        self._database: sqlite3.Connection | None = None
        self._try_at = float("-inf")
        self._prune_at = float("-inf")

    def add(self, robot: str, event: EventReport) -> None:
        """Take an event of a robot, empty for the edge's own; from any thread. Never blocks, never raises."""
        self._waiting.append(row_of(robot, event))
        self.on_event(robot, event)
        if len(self._waiting) > WAITING:
            with contextlib.suppress(IndexError):  # the writer has taken them meanwhile
                self._waiting.popleft()
                self._lost += 1

    def waiting(self) -> list[Record]:
        """Return the events that are not on disk yet, the oldest first; from any thread."""
        return [record_of(row) for row in list(self._waiting)]

    def write(self) -> None:
        """Write the waiting events and enforce the retention limits; only on a thread that may block."""
        now = self._clock.monotonic()
        if now < self._try_at or not (self._waiting or now >= self._prune_at):
            return
        try:
            database = self._opened()
            self._commit(database)
            if now >= self._prune_at:
                self._prune_at = now if self._prune(database) else now + PRUNE_EVERY
        except Exception as error:  # noqa: BLE001 - the journal's thread must go on
            self._fail(error)
            self._try_at = now + RETRY_AFTER
        else:
            self.problem = ""

    def close(self) -> None:
        """Write the waiting events a last time and close the file; only on a thread that may block."""
        self._try_at = float("-inf")
        self._lock_timeout = LAST_LOCK_TIMEOUT
        if self._database is not None:
            self._database.execute(f"PRAGMA busy_timeout = {LAST_LOCK_TIMEOUT * 1000:.0f}")
        self.write()
        self._close_file()

    def _opened(self) -> sqlite3.Connection:
        """Return the open file, opening it if necessary; raises StateError, OSError, sqlite3.Error."""
        path = self.folder / HISTORY
        if not path.exists():  # not yet created, or deleted while open: writes to it would be lost
            self._close_file()
        if self._database is None:
            create_folder(self.folder)
            try:
                with locked(path, within=self._lock_timeout):
                    self._database, _ = open_checked(path, FORMATS, "NORMAL", busy=self._lock_timeout)
            except StateTaken:
                raise StateError(f"another process is just opening {path}") from None
        return self._database

    def _close_file(self) -> None:
        """Close the file."""
        if self._database is not None:
            with contextlib.suppress(sqlite3.Error):
                self._database.close()
            self._database = None

    def _commit(self, database: sqlite3.Connection) -> None:
        """Write all waiting events in one transaction; they keep waiting if it fails."""
        rows = list(self._waiting)
        lost = self._lost
        if lost:
            text = f"{lost} events were lost: the disk did not take them, and memory was full"
            event = EventReport(self._clock.time(), EventKind.HEALTH, text, Severity.ERROR)
            rows.append(row_of("", event))
        if not rows:
            return
        with transaction(database):
            database.executemany(_ADD, rows)
        self._lost -= lost
        for row in rows:  # ``add`` may have dropped some of them meanwhile, to make room for newer ones
            if self._waiting and self._waiting[0] is row:
                self._waiting.popleft()

    def _prune(self, database: sqlite3.Connection) -> bool:
        """Delete some of the events beyond the limits; return True when more remain."""
        oldest = self._clock.time() - self._bounds.age
        deleted = database.execute(_TOO_OLD, (oldest, NEWEST, AT_ONCE)).rowcount
        pages, free = (
            database.execute(f"PRAGMA {each}").fetchone()[0] for each in ("page_count", "freelist_count")
        )
        if (pages - free) * PAGE > self._bounds.size:
            deleted += database.execute(_OLDEST, (AT_ONCE,)).rowcount
        return bool(deleted >= AT_ONCE)

    def _fail(self, error: Exception) -> None:
        """Report that events are kept only in memory; a damaged file is moved aside when opened again."""
        if isinstance(error, sqlite3.Error) and (is_corrupt(error) or _may_heal(error)):
            self._close_file()
        problem = f"the history is kept in memory only: {error}"
        if problem != self.problem:
            log.error("%s", problem)
        self.problem = problem


def _may_heal(error: sqlite3.Error) -> bool:
    """Return True for a file on a disk that failed or is read-only: it must be opened again to recover."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_IOERR)
