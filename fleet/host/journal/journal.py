"""Journal of started commands and set emergency stops, which safety needs after the death of the process.

A discrete command is written to the execution journal before it is executed, and soon to disk, so that a
restart never repeats it; an emergency stop takes the same path. One thread writes for all robots of a
process, everything that waits in one commit; no event loop waits for the disk.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.errors import StateError
from fleet.host.journal.execution_journal import ANY, ExecutionJournal, Latched, Row, Started
from fleet.host.journal.past_commands import DONE, InterruptedCommand, PastCommand, answer_to
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.dedup_cache import KEPT, DedupCache
from fleet.model.command import Reply
from fleet.spool.database import open_checked
from fleet.spool.state_folder import JOURNAL, create_folder, locked

log = logging.getLogger(__name__)

GATHER = 0.05
"""Seconds in which changes are collected before a commit. A thread that woke for each command would compete
for the interpreter just when the command is on its way to the robot."""
LONGEST = 1 << 22
"""Bytes of commands that are kept in memory while the disk takes none."""
RETRY = 1.0  # s between attempts to write stops that the disk did not take
REMEMBERED = 3600.0  # s that a command is kept; an older one is refused for its age
LOST = "the journal could not be read or written, so nobody knows whether a stop was set"

FORMATS = (
    """
CREATE TABLE begun (
    robot TEXT, identity TEXT, name TEXT, action INTEGER, stamp REAL, outcome TEXT,
    PRIMARY KEY (robot, identity)
) WITHOUT ROWID;
CREATE INDEX begun_by_stamp ON begun (stamp);
CREATE TABLE latch (robot TEXT PRIMARY KEY, why TEXT) WITHOUT ROWID;
""",
    "ALTER TABLE begun ADD COLUMN way TEXT NOT NULL DEFAULT ''",
)
"""SQL that creates the file, and migrates it from each format number to the next."""
_BEGIN = "INSERT OR REPLACE INTO begun (robot, identity, name, action, stamp, way, outcome) VALUES "
_ROW = "(?, ?, ?, ?, ?, ?, ?)"
_AT_ONCE = 100  # rows per statement; SQLite allows at least 999 values
_RECOVER = (
    "INSERT OR IGNORE INTO begun (robot, identity, name, action, stamp, way, outcome) "
    "VALUES (?, ?, ?, ?, ?, ?, '')"
)
_INTERRUPTED = (
    "SELECT robot, identity, name, way FROM begun "
    "WHERE outcome = '' AND way <> '' AND robot = ? AND stamp >= ? ORDER BY stamp"
)
_TOLD = "UPDATE begun SET way = '' WHERE outcome = '' AND way <> '' AND robot = ?"
_END = "UPDATE begun SET outcome = ? WHERE robot = ? AND identity = ?"
_LATCH = "INSERT OR REPLACE INTO latch VALUES (?, ?)"
_RECOVERED = {Started: _RECOVER, Latched: _LATCH}
_FORGET = "DELETE FROM begun WHERE stamp < ?"
_PROBE = (
    "BEGIN IMMEDIATE",
    "INSERT INTO latch VALUES ('', '')",
    "DELETE FROM latch WHERE robot = ''",
    "COMMIT",
)
"""A write without a trace: a full disk can still be read, but not written."""


class CommandEnd(msgspec.Struct, frozen=True):
    """End of a command; ``outcome`` is one word."""

    outcome: str
    robot: str
    identity: str


Change = Row | CommandEnd
"""One change of the journal; a row of ``ExecutionJournal`` is one that must not wait for the disk."""


class _NetChanges:
    """Net effect of a series of changes.

    ``begun`` has a row with its outcome for each new command; ``ended`` the ends of earlier commands.
    """

    def __init__(self, changes: Sequence[Change]) -> None:
        self.ended: list[CommandEnd] = []
        self.begun: dict[tuple[str, str], list[object]] = {}
        self.latches: dict[str, str] = {}
        for change in changes:
            if isinstance(change, Latched):
                self.latches[change.robot] = change.why
            elif isinstance(change, Started):
                self.begun[change.robot, change.identity] = [*msgspec.structs.astuple(change), ""]
            elif begun := self.begun.get((change.robot, change.identity)):
                begun[-1] = change.outcome
            else:
                self.ended.append(change)


def _forget(_change: Change) -> None:
    """Discard a change."""


class RobotJournal:
    """Journal of one robot. ``put`` takes a change from any thread and never blocks; the default drops it."""

    def __init__(
        self,
        robot: str = "",
        put: Callable[[Change], None] = _forget,
        *,
        latched: str = "",
        past: Sequence[PastCommand] = (),
        clock: Clock | None = None,
    ) -> None:
        self.latched = latched
        self.past = past
        self._robot = robot
        self._put = put
        self._clock = clock

    @property
    def cut_off(self) -> bool:
        """True when an action of an earlier process has no known end: the robot may still be moving."""
        return any(past.action and not past.outcome for past in self.past)

    def latch(self, why: str) -> None:
        """Record an emergency stop, or with an empty ``why`` its release; from any thread."""
        self._put(Latched(self._robot, why))

    def note(self, identity: str, name: str, *, action: bool = False, way: str = "") -> None:
        """Record that a command is being executed; without an identity it cannot repeat and is not kept."""
        if identity and self._clock is not None:
            self._put(Started(self._robot, identity, name, action, self._clock.time(), way))

    def end(self, identity: str, outcome: str) -> None:
        """Record the outcome of a command, as one word."""
        if identity:
            self._put(CommandEnd(outcome, self._robot, identity))

    def follow(self, identity: str, receipt: Receipt) -> None:
        """Record the outcome of a command once its receipt has it."""
        receipt.watch(partial(self._seen, identity))

    def repeats(self, now: float) -> DedupCache[Receipt]:
        """Return the answers to commands of earlier processes; ``now``: monotonic seconds."""
        repeats: DedupCache[Receipt] = DedupCache()
        for past in self.past:
            if not past.action:
                repeats.first(past.identity, answer_to(past), now)
        return repeats

    def _seen(self, identity: str, reply: Reply) -> None:
        """Record the outcome in a command's reply."""
        if reply.done is not None:
            self.end(identity, DONE if reply.done else "failed")


class Journal:
    """Journal of one process. The workers of an edge share the database.

    A disk that fails later is reported in ``problem``; records are lost, but robots keep obeying. After a
    database that could not be read, or not be written at the start, the emergency stop of every robot is set,
    because a stop may have been set before and would be unknown.

    A set stop also stays in the execution journal until its release, so that it survives the loss of one of
    the two files.

    ``ends_are_told`` returns whether the ends of commands are still reported to their senders: a worker
    outlives its edge for a moment, and leaves them open for the next edge.

    ``also`` is called on the journal's thread after each round, for other writes to the disk; it never
    raises.
    """

    def __init__(
        self, folder: Path, clock: Clock, begun: Path, also: Callable[[], None] = lambda: None
    ) -> None:
        self.problem = ""
        self.ends_are_told: Callable[[], bool] = lambda: True
        self._also = also
        self._clock = clock
        self._adding = threading.Lock()  # covers adding to both the queue and the execution journal
        self._set: dict[str, str] = {}  # robot to cause: the emergency stops that are set
        self._execution_journal = self._open_begun(begun)
        self._waiting: deque[Change] = deque()
        self._unwritten: dict[str, str] = {}  # stops and releases that the database does not have yet
        self._closing = threading.Event()
        self._using = threading.Lock()  # one thread at a time: a reader would delay a writer
        self._database = self._open_database(folder)
        self._thread = threading.Thread(target=self._write, name="fleet-journal", daemon=True)
        self._thread.start()

    def _open_begun(self, path: Path) -> ExecutionJournal | None:
        """Open the execution journal; None, with ``problem`` set, if that fails."""
        try:
            return ExecutionJournal(path)
        except OSError as error:
            self._fail(error)
            return None

    def _open_database(self, folder: Path) -> sqlite3.Connection | None:
        """Open and migrate the database; None, with ``problem`` set, if it cannot be written."""
        database: sqlite3.Connection | None = None
        path = folder / JOURNAL
        try:
            create_folder(folder)
            with locked(path):
                database, aside = open_checked(path, FORMATS, "FULL")
                if aside is not None:
                    database.execute(_LATCH, (ANY, LOST))
                for step in _PROBE:
                    database.execute(step)
                self._recover(database)
        except (StateError, sqlite3.Error, OSError) as error:
            self._fail(error)
            if database is not None:
                database.close()
            return None
        return database

    def _recover(self, database: sqlite3.Connection) -> None:
        """Write the rows that earlier processes left in their execution journals."""
        if self._execution_journal is not None:
            with self._execution_journal.all_rows() as rows:
                for row in rows:
                    if isinstance(row, Latched) and row.robot == ANY:  # earlier releases do not count
                        database.execute("DELETE FROM latch WHERE why = ''")
                    database.execute(_RECOVERED[type(row)], msgspec.structs.astuple(row))

    def _add(self, row: Row) -> None:
        """Write a row to the execution journal; never raises."""
        if self._execution_journal is not None:
            try:
                self._execution_journal.add(row)
            except Exception as error:  # noqa: BLE001 - a stop must not fail because of its record
                self._fail(error)

    def _clear(self) -> None:
        """Empty the execution journal, except for the stops that are set."""
        if self._execution_journal is not None:
            self._execution_journal.clear()
            for robot, why in self._set.items():
                self._add(Latched(robot, why))

    def robot(self, name: str) -> RobotJournal:
        """Return the journal of one robot, with its records of earlier processes."""
        latched = LOST
        past: list[PastCommand] = []
        try:
            with self._using:
                latched, past = self._recall(name)
        except sqlite3.Error as error:
            self._fail(error)
        with self._adding:
            latched = self._set.get(name) or latched  # the database may not have it yet
            if latched:
                self._set[name] = latched
                self._add(Latched(name, latched))
        if latched:
            log.warning("%s: the emergency stop is still set: %s", name, latched)
        return RobotJournal(name, self._put, latched=latched, past=past, clock=self._clock)

    def take_interrupted(self, names: Iterable[str]) -> list[InterruptedCommand]:
        """Return the commands of these robots that an earlier process did not see end; each once."""
        found: list[InterruptedCommand] = []
        if self._database is None:
            return found
        try:
            with self._using:
                for name in names:
                    found += self._taken(self._database, name)
        except sqlite3.Error as error:
            self._fail(error)
        return found

    def close(self) -> None:
        """Write all waiting changes and close the files; a stop after that is left to the next process."""
        self._closing.set()
        self._thread.join()
        if self._database is not None:
            self._database.close()
        with self._adding:
            if not self.problem and not self._waiting:
                self._clear()
            begun, self._execution_journal = self._execution_journal, None
            if begun is not None:
                begun.close()

    def _put(self, change: Change) -> None:
        """Add a change; from here on, a started command or a stop survives the process."""
        if isinstance(change, CommandEnd) and not self.ends_are_told():
            return
        with self._adding:
            if not isinstance(change, CommandEnd):
                self._add(change)
            if isinstance(change, Latched):
                self._set[change.robot] = change.why
                if not change.why:
                    del self._set[change.robot]
            self._waiting.append(change)

    def _recall(self, name: str) -> tuple[str, list[PastCommand]]:
        """Return the robot's emergency stop and its commands, oldest first."""
        if self._database is None:
            return LOST, []
        since = self._clock.time() - REMEMBERED
        latches = dict(
            self._database.execute("SELECT robot, why FROM latch WHERE robot IN (?, ?)", (name, ANY))
        )
        rows = self._database.execute(
            "SELECT identity, name, action, outcome FROM begun WHERE robot = ? AND stamp >= ? "
            "ORDER BY stamp DESC LIMIT ?",
            (name, since, KEPT),
        )
        past = [
            PastCommand(identity, command, bool(action), outcome)
            for identity, command, action, outcome in rows
        ]
        return latches.get(name, latches.get(ANY, "")), past[::-1]

    def _taken(self, database: sqlite3.Connection, name: str) -> list[InterruptedCommand]:
        """Return the commands of one robot without a known end, and mark them as reported."""
        rows = database.execute(_INTERRUPTED, (name, self._clock.time() - REMEMBERED)).fetchall()
        database.execute(_TOLD, (name,))
        return [InterruptedCommand(*row) for row in rows]

    def _write(self) -> None:
        """Thread: write everything that waits in one commit."""
        closing, retry_at = False, 0.0
        while not closing:
            closing = self._closing.wait(GATHER)
            changes = [self._waiting.popleft() for _ in range(len(self._waiting))]
            # A stop must get to disk even if no command follows: a reboot empties the execution journal.
            if changes or (self._unwritten and (closing or self._clock.monotonic() >= retry_at)):
                self._keep(changes)
                retry_at = self._clock.monotonic() + RETRY
            self._also()

    def _keep(self, changes: Sequence[Change]) -> None:
        """Write changes to disk; after that they are not needed in the execution journal."""
        with self._using:
            self._commit(changes)
        with self._adding:
            full = self._execution_journal is not None and self._execution_journal.length > LONGEST
            if not self._waiting and (full or not self.problem):
                self._clear()

    def _commit(self, changes: Sequence[Change]) -> None:
        """Write changes; a failure is reported in ``problem``, and logged once for each kind.

        Commands are written many per call: each call releases and reacquires the interpreter lock, for which
        a command on its way to a robot would have to wait.
        """
        if self._database is None:
            return
        total = _NetChanges(changes)
        self._unwritten |= total.latches
        try:
            self._database.execute("BEGIN IMMEDIATE")
            self._database.executemany(_END, map(msgspec.structs.astuple, total.ended))
            begun = list(total.begun.values())
            for start in range(0, len(begun), _AT_ONCE):
                rows = begun[start : start + _AT_ONCE]
                values = itertools.chain.from_iterable(rows)
                self._database.execute(_BEGIN + ", ".join([_ROW] * len(rows)), tuple(values))
            self._database.executemany(_LATCH, self._unwritten.items())
            self._database.execute(_FORGET, (self._clock.time() - REMEMBERED,))
            self._database.execute("COMMIT")
            self._unwritten = {}
            self.problem = ""
        except sqlite3.Error as error:
            with contextlib.suppress(sqlite3.Error):
                self._database.execute("ROLLBACK")
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Report that the journal is not being kept."""
        problem = f"the journal of commands is not kept: {error}"
        if problem != self.problem:
            log.error("%s", problem)
        self.problem = problem
