"""What safety must remember though the process dies: commands that were begun, emergency stops that are set.

A discrete command is in ``begun`` before it is carried out, and soon on disk, so that a restart never does it
twice; an emergency stop goes the same way. One thread writes for all robots of a process, all that waits in
one commit; nobody's event loop waits for the disk.
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
"""Seconds in which changes gather for the disk; a thread that woke for each command would want the
interpreter just when the command is on its way to the robot."""
LONGEST = 1 << 22
"""Bytes of commands that are kept in memory while the disk takes none."""
REMEMBERED = 3600.0  # s that a command is kept; older ones are refused by their age
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
"""What makes the file, and brings it from each format number to the next."""
_BEGIN = "INSERT OR REPLACE INTO begun (robot, identity, name, action, stamp, way, outcome) VALUES "
_ROW = "(?, ?, ?, ?, ?, ?, ?)"
_AT_ONCE = 100  # rows of one statement; SQLite takes 999 values at least
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
"""Writes, and leaves nothing: a disk that is full can still be read."""


class CommandEnd(msgspec.Struct, frozen=True):
    """How a command ended, in a word."""

    outcome: str
    robot: str
    identity: str


Change = Row | CommandEnd
"""One change of the journal; a row of ``ExecutionJournal`` is what must not wait for the disk."""


class _Sum:
    """What some changes come to, in their order.

    ``begun`` has a list for each command, with how it ended; ``ended`` those that began before.
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
    """Keep none."""


class RobotJournal:
    """One robot's part. ``put`` takes a change from any thread and never blocks; without it none is kept."""

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
        """True when an action of an earlier process was not seen to end: the robot may still be at it."""
        return any(past.action and not past.outcome for past in self.past)

    def latch(self, why: str) -> None:
        """Remember an emergency stop, or with an empty ``why`` its release; from any thread."""
        self._put(Latched(self._robot, why))

    def note(self, identity: str, name: str, *, action: bool = False, way: str = "") -> None:
        """Remember that a command is now carried out; what can never be a repeat (no identity) is not."""
        if identity and self._clock is not None:
            self._put(Started(self._robot, identity, name, action, self._clock.time(), way))

    def end(self, identity: str, outcome: str) -> None:
        """Remember how a command ended; in a word."""
        if identity:
            self._put(CommandEnd(outcome, self._robot, identity))

    def follow(self, identity: str, receipt: Receipt) -> None:
        """Remember how a command will end."""
        receipt.watch(partial(self._seen, identity))

    def repeats(self, now: float) -> DedupCache[Receipt]:
        """Return the answers to the commands of earlier processes; ``now``: monotonic seconds."""
        repeats: DedupCache[Receipt] = DedupCache()
        for past in self.past:
            if not past.action:
                repeats.first(past.identity, answer_to(past), now)
        return repeats

    def _seen(self, identity: str, reply: Reply) -> None:
        """Take a command's answer."""
        if reply.done is not None:
            self.end(identity, DONE if reply.done else "failed")


class Journal:
    """The journal of one process. Workers of one edge share the file.

    A disk that fails later is told in ``problem`` and costs what is remembered, not the robots' obedience.
    After a file that could not be read, or a disk that could not be written at the start, every robot's
    emergency stop is set: somebody may have set it, and nobody would know.

    A stop that is set stays in ``begun``, too, until it is released: whoever loses one of the two files has
    the other.

    ``ends_are_told`` says whether anybody still tells askers how commands end: a worker outlives its edge for
    a moment, and leaves them open for the next edge.

    ``also`` is called on the journal's thread after each turn: what else may wait for the disk; never raises.
    """

    def __init__(
        self, folder: Path, clock: Clock, begun: Path, also: Callable[[], None] = lambda: None
    ) -> None:
        self.problem = ""
        self.ends_are_told: Callable[[], bool] = lambda: True
        self._also = also
        self._clock = clock
        self._adding = threading.Lock()  # what is added waits, or is done with, in both places
        self._set: dict[str, str] = {}  # why, by robot: the emergency stops that are set
        self._begun = self._open_begun(begun)
        self._waiting: deque[Change] = deque()
        self._closing = threading.Event()
        self._using = threading.Lock()  # one thread at a time: a reader would hold a writer up
        self._database = self._open_database(folder)
        self._thread = threading.Thread(target=self._write, name="fleet-journal", daemon=True)
        self._thread.start()

    def _open_begun(self, path: Path) -> ExecutionJournal | None:
        """Open the file in memory; None, and told, where that cannot be."""
        try:
            return ExecutionJournal(path)
        except OSError as error:
            self._fail(error)
            return None

    def _open_database(self, folder: Path) -> sqlite3.Connection | None:
        """Open the file on disk and bring it up to date; None, and told, where it cannot be written."""
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
        """Write what earlier processes left in memory."""
        if self._begun is not None:
            with self._begun.everybodys() as rows:
                for row in rows:
                    if isinstance(row, Latched) and row.robot == ANY:  # releases of before are none of it
                        database.execute("DELETE FROM latch WHERE why = ''")
                    database.execute(_RECOVERED[type(row)], msgspec.structs.astuple(row))

    def _add(self, row: Row) -> None:
        """Write a row into the file in memory; never raises."""
        if self._begun is not None:
            try:
                self._begun.add(row)
            except Exception as error:  # noqa: BLE001 - a stop must not fail by its record
                self._fail(error)

    def _clear(self) -> None:
        """Empty the file in memory, but for the stops that are set."""
        if self._begun is not None:
            self._begun.clear()
            for robot, why in self._set.items():
                self._add(Latched(robot, why))

    def robot(self, name: str) -> RobotJournal:
        """Return the part of one robot, with what is known of it from earlier processes."""
        latched = LOST
        past: list[PastCommand] = []
        try:
            with self._using:
                latched, past = self._recall(name)
        except sqlite3.Error as error:
            self._fail(error)
        with self._adding:
            latched = self._set.get(name) or latched  # it may be on its way to the disk
            if latched:
                self._set[name] = latched
                self._add(Latched(name, latched))
        if latched:
            log.warning("%s: the emergency stop is still set: %s", name, latched)
        return RobotJournal(name, self._put, latched=latched, past=past, clock=self._clock)

    def take_interrupted(self, names: Iterable[str]) -> list[InterruptedCommand]:
        """Return the commands of these robots that an earlier process left without an end; each once."""
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
        """Write what waits and close the files; a stop that comes so late is left to the next process."""
        self._closing.set()
        self._thread.join()
        if self._database is not None:
            self._database.close()
        with self._adding:
            if not self.problem and not self._waiting:
                self._clear()
            begun, self._begun = self._begun, None
            if begun is not None:
                begun.close()

    def _put(self, change: Change) -> None:
        """Take a change: what is begun, and a stop, outlive the process from here on."""
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
        """Return the robot's emergency stop and its commands, the oldest first."""
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
        """Return the commands of one robot that nobody saw end, and forget who asked for them."""
        rows = database.execute(_INTERRUPTED, (name, self._clock.time() - REMEMBERED)).fetchall()
        database.execute(_TOLD, (name,))
        return [InterruptedCommand(*row) for row in rows]

    def _write(self) -> None:
        """Be the thread: everything that waits goes into one commit."""
        closing = False
        while not closing:
            closing = self._closing.wait(GATHER)
            changes = [self._waiting.popleft() for _ in range(len(self._waiting))]
            if changes:
                self._keep(changes)
            self._also()

    def _keep(self, changes: Sequence[Change]) -> None:
        """Write changes; what is on disk need not be in the file in memory any more."""
        with self._using:
            self._commit(changes)
        with self._adding:
            full = self._begun is not None and self._begun.length > LONGEST
            if not self._waiting and (full or not self.problem):
                self._clear()

    def _commit(self, changes: Sequence[Change]) -> None:
        """Write changes; what the disk does not take is told, once for each kind of trouble.

        Commands go many in one call: with each call the interpreter is given away and wanted back, and a
        command that is on its way waits meanwhile.
        """
        if self._database is None:
            return
        total = _Sum(changes)
        try:
            self._database.execute("BEGIN IMMEDIATE")
            self._database.executemany(_END, map(msgspec.structs.astuple, total.ended))
            begun = list(total.begun.values())
            for start in range(0, len(begun), _AT_ONCE):
                rows = begun[start : start + _AT_ONCE]
                values = itertools.chain.from_iterable(rows)
                self._database.execute(_BEGIN + ", ".join([_ROW] * len(rows)), tuple(values))
            self._database.executemany(_LATCH, total.latches.items())
            self._database.execute(_FORGET, (self._clock.time() - REMEMBERED,))
            self._database.execute("COMMIT")
            self.problem = ""
        except sqlite3.Error as error:
            with contextlib.suppress(sqlite3.Error):
                self._database.execute("ROLLBACK")
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Tell that what is done now is not remembered."""
        problem = f"the journal of commands is not kept: {error}"
        if problem != self.problem:
            log.error("%s", problem)
        self.problem = problem
