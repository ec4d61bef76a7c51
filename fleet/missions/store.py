"""Persistent state of runs: the frozen program, the position, the started parts, the log.

An SQLite file beside the journal, written by a thread of its own, with one synchronised commit per change:
``save`` calls back when a change is on disk, and only then is a robot commanded. So every command that was
sent is recorded, and a recorded part never begins again.

==========================  ==========================================================================
failure                     reaction of the store
==========================  ==========================================================================
disk full, read-only        no run is started; runs in progress continue, reported in ``problem``
file damaged                set aside and replaced, reported in ``lost`` until the process ends
too many ended runs         the oldest are deleted with their logs
==========================  ==========================================================================
"""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec

from fleet.errors import StateError
from fleet.missions.program import Program
from fleet.missions.state import LogNote, RunHead, RunMember, RunOutcome, StepPart
from fleet.runtime.decoding import decode_json
from fleet.spool.database import open_checked, transaction
from fleet.spool.state_folder import create_folder, locked

log = logging.getLogger(__name__)

MISSIONS = "missions.db"
SCHEMA = """
CREATE TABLE run (
    id TEXT PRIMARY KEY, about TEXT, program TEXT, head TEXT, ended INTEGER, stamp REAL, elapsed REAL
) WITHOUT ROWID;
CREATE TABLE member (run TEXT, robot TEXT, state TEXT, PRIMARY KEY (run, robot)) WITHOUT ROWID;
CREATE TABLE part (run TEXT, identity TEXT, state TEXT, PRIMARY KEY (run, identity)) WITHOUT ROWID;
CREATE TABLE note (id INTEGER PRIMARY KEY, run TEXT, stamp REAL, step TEXT, robot TEXT, text TEXT);
CREATE INDEX note_by_run ON note (run, id);
"""
FORMATS = (SCHEMA,)
"""Migrations of the file from each format number to the next (``fleet.runtime.state_format``)."""
KEPT = 500  # ended runs
_RUN = "INSERT OR REPLACE INTO run VALUES (?, ?, ?, ?, ?, ?, ?)"
_HEAD = "UPDATE run SET head = ?, ended = ?, stamp = ?, elapsed = ? WHERE id = ?"
_encode = msgspec.json.Encoder().encode


class RunOrigin(msgspec.Struct, frozen=True, omit_defaults=True):
    """Origin of a run: user, time (Unix s) and inputs; ``hash`` covers the program and the roles.

    ``transport`` and ``source_type`` are the authority under which its robots are commanded. ``workflow`` is
    the workflow of the cloud that started it.
    """

    run: str
    mission: str
    hash: str
    started: float
    by: str = ""
    transport: str = msgspec.field(name="way", default="bus")
    source_type: str | None = None
    inputs: dict[str, object] = {}
    workflow: str = ""


class RunLogEntry(msgspec.Struct, frozen=True, omit_defaults=True):
    """One line of a run's log; ``stamp`` is Unix seconds."""

    stamp: float
    text: str
    step: str = ""
    robot: str = ""


class RunChange(msgspec.Struct, frozen=True):
    """Changes of a run by one event. ``elapsed``: seconds of the run's clock, at ``stamp`` (Unix s)."""

    run: str
    head: RunHead
    touched: Sequence[StepPart | RunMember]
    notes: Sequence[LogNote]
    stamp: float
    elapsed: float
    about: RunOrigin | None = None  # only for a new run, with its program
    program: Program | None = None


class StoredRun(msgspec.Struct, frozen=True):
    """A stored run."""

    about: RunOrigin
    program: Program
    head: RunHead
    members: list[RunMember]
    parts: list[StepPart]
    stamp: float
    elapsed: float


class RunStore:
    """The runs of one edge. ``problem``: why they are not on disk, empty while they are.

    ``lost``: the runs of earlier processes that could not be read.
    """

    def __init__(self, folder: Path) -> None:
        self.problem = self.lost = ""
        self._path = folder / MISSIONS
        self._database: sqlite3.Connection | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="fleet-missions")
        try:
            create_folder(folder)
            with locked(self._path):
                self._database, aside = open_checked(self._path, FORMATS, "FULL")
            if aside is not None:
                self.lost = f"the runs of missions could not be read: set aside as {aside.name}"
        except (StateError, sqlite3.Error, OSError) as error:
            self._fail(error)

    def save(self, change: RunChange, done: Callable[[bool], None]) -> None:
        """Record a change; ``done`` is called on the store's thread with its success. Never raises."""
        head = _encode(change.head)
        rows = [(isinstance(each, StepPart), _key(each), _encode(each)) for each in change.touched]
        try:
            self._thread.submit(self._write, change, head, rows, done)
        except RuntimeError:  # the store is closed
            done(False)

    def knows(self, run: str) -> bool:
        """Return True if a run of this id is stored, in progress or ended; waits for the disk."""
        return bool(self._thread.submit(self._rows_of, run).result())

    def has_ended(self, run: str) -> bool:
        """Return True if a stored run of this id has ended; waits for the disk."""
        return any(ended for (ended,) in self._thread.submit(self._rows_of, run).result())

    def unfinished(self) -> list[StoredRun]:
        """Return the unfinished runs; call it before the first save. Unreadable runs are reported."""
        if self._database is None:
            return []
        try:
            rows = self._database.execute(
                "SELECT id, about, program, head, stamp, elapsed FROM run WHERE NOT ended ORDER BY stamp"
            ).fetchall()
        except sqlite3.Error as error:
            self._fail(error)
            return []
        found = []
        for run, about, program, head, stamp, elapsed in rows:
            try:
                found.append(self._stored_run(run, about, program, head, stamp, elapsed))
            except (msgspec.DecodeError, sqlite3.Error) as error:
                self.lost = f"run {run} cannot be read, its outcome is unknown: {error}"
                log.error("%s", self.lost)  # noqa: TRY400 - reported in the edge's health
                with contextlib.suppress(sqlite3.Error):
                    self._database.execute("UPDATE run SET ended = 2 WHERE id = ?", (run,))
        return found

    def _rows_of(self, run: str) -> list[tuple[int]]:
        """Return whether a run has ended; empty for an unknown run, or if the file fails."""
        if self._database is None:
            return []
        try:
            return self._database.execute("SELECT ended FROM run WHERE id = ?", (run,)).fetchall()
        except sqlite3.Error as error:  # then no run is started either
            self._fail(error)
            return []

    def ended(
        self, most: int, callback: Callable[[list[tuple[RunOrigin, RunHead, list[RunMember]]]], None]
    ) -> None:
        """Pass the ended runs, newest first, to ``callback``, on the store's thread."""
        self._thread.submit(lambda: callback(self._ended(most)))

    def ended_run(
        self, run: str, callback: Callable[[tuple[RunOrigin, RunHead, list[RunMember]] | None], None]
    ) -> None:
        """Pass an ended run to ``callback``, on the store's thread; None if there is none of this id."""
        try:
            self._thread.submit(lambda: callback(self._ended_run(run)))
        except RuntimeError:  # the store is closed
            callback(None)

    def story(self, run: str, callback: Callable[[list[RunLogEntry]], None]) -> None:
        """Pass the log of a run, oldest line first, to ``callback``, on the store's thread."""
        self._thread.submit(lambda: callback(self._story(run)))

    def close(self) -> None:
        """Complete the waiting writes and close the file."""
        self._thread.shutdown()
        if self._database is not None:
            self._database.close()
            self._database = None

    def _stored_run(  # noqa: PLR0917 - a row
        self, run: str, about: str, program: str, head: str, stamp: float, elapsed: float
    ) -> StoredRun:
        """Return a run from its rows; raises DecodeError, sqlite3.Error."""
        return StoredRun(
            decode_json(about.encode(), RunOrigin),
            decode_json(program.encode(), Program),
            decode_json(head.encode(), RunHead),
            [decode_json(row.encode(), RunMember) for row in self._states("member", run)],
            [decode_json(row.encode(), StepPart) for row in self._states("part", run)],
            stamp,
            elapsed,
        )

    def _states(self, table: str, run: str) -> list[str]:
        """Return the stored members or parts of a run."""
        assert self._database is not None
        rows = self._database.execute(f"SELECT state FROM {table} WHERE run = ?", (run,))  # noqa: S608 - constant
        return [state for (state,) in rows]

    def _write(
        self,
        change: RunChange,
        head: bytes,
        rows: list[tuple[bool, str, bytes]],
        done: Callable[[bool], None],
    ) -> None:
        """Commit a change; on the store's thread."""
        try:
            if self._database is None:
                raise sqlite3.OperationalError("there is no file")
            self._commit(self._database, change, head, rows)
        except sqlite3.Error as error:
            self._fail(error)
            done(False)
        else:
            done(True)

    def _commit(
        self,
        database: sqlite3.Connection,
        change: RunChange,
        head: bytes,
        rows: list[tuple[bool, str, bytes]],
    ) -> None:
        """Write a change in one transaction."""
        run, ended = change.run, change.head.outcome is not None
        with transaction(database):
            if change.about is not None:
                about, program = _encode(change.about).decode(), _encode(change.program).decode()
                values = (run, about, program, head.decode(), ended, change.stamp, change.elapsed)
                database.execute(_RUN, values)
            else:
                database.execute(_HEAD, (head.decode(), ended, change.stamp, change.elapsed, run))
            for is_part, key, state in rows:
                table = "part" if is_part else "member"
                sql = f"INSERT OR REPLACE INTO {table} VALUES (?, ?, ?)"  # noqa: S608 - constant
                database.execute(sql, (run, key, state.decode()))
            database.executemany(
                "INSERT INTO note (run, stamp, step, robot, text) VALUES (?, ?, ?, ?, ?)",
                [(run, change.stamp, each.step, each.robot, each.text) for each in change.notes],
            )
            if ended:
                self._prune(database)

    def _prune(self, database: sqlite3.Connection) -> None:
        """Delete the oldest ended runs beyond the limit."""
        old = "SELECT id FROM run WHERE ended ORDER BY stamp DESC LIMIT -1 OFFSET ?"
        gone = [run for (run,) in database.execute(old, (KEPT,))]
        for table, column in (("note", "run"), ("part", "run"), ("member", "run"), ("run", "id")):
            database.executemany(f"DELETE FROM {table} WHERE {column} = ?", [(run,) for run in gone])  # noqa: S608 - constant

    def _ended_run(self, run: str) -> tuple[RunOrigin, RunHead, list[RunMember]] | None:
        """Read an ended run; None if there is none, or the file fails."""
        try:
            return next(iter(self._ended(1, run)), None)
        except (msgspec.DecodeError, sqlite3.Error) as error:
            self._fail(error)
            return None

    def _ended(self, most: int, run: str = "") -> list[tuple[RunOrigin, RunHead, list[RunMember]]]:
        """Read the ended runs, or one of them."""
        if self._database is None:
            return []
        rows = self._database.execute(
            "SELECT id, about, head FROM run WHERE ended = 1 AND ? IN ('', id) ORDER BY stamp DESC LIMIT ?",
            (run, most),
        ).fetchall()
        return [
            (
                decode_json(about.encode(), RunOrigin),
                decode_json(head.encode(), RunHead),
                [decode_json(row.encode(), RunMember) for row in self._states("member", run)],
            )
            for run, about, head in rows
        ]

    def _story(self, run: str) -> list[RunLogEntry]:
        """Read the log of a run."""
        if self._database is None:
            return []
        rows = self._database.execute(
            "SELECT stamp, text, step, robot FROM note WHERE run = ? ORDER BY id", (run,)
        )
        return [RunLogEntry(*row) for row in rows]

    def _fail(self, error: Exception) -> None:
        """Record and log that runs are not stored."""
        problem = f"the runs of missions are not recorded: {error}"
        if problem != self.problem:
            log.error("%s", problem)
        self.problem = problem


def _key(each: StepPart | RunMember) -> str:
    """Return the key of a part or a member in its run."""
    return each.identity if isinstance(each, StepPart) else each.robot


def is_good(outcome: RunOutcome | None) -> bool:
    """Return True if a run completed its mission."""
    return outcome in (RunOutcome.COMPLETED, RunOutcome.WITH_LOSSES)
