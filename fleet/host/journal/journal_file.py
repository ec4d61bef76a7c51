"""The database of the journal: started commands and set emergency stops, shared by the workers of an edge."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path

import msgspec

from fleet.host.journal.changes import NetChanges
from fleet.host.journal.execution_journal import ANY, JournalRow, Latched, StartedCommand
from fleet.host.journal.past_commands import InterruptedCommand, PastCommand
from fleet.host.journal.unwritten_mark import UnwrittenMark, remove
from fleet.host.safety.dedup_cache import KEPT
from fleet.spool.database import open_checked, transaction
from fleet.spool.state_folder import JOURNAL, create_folder, locked

REMEMBERED = 3600.0  # s that a command is kept; an older one is refused for its age
LOST = "the journal could not be read or written, so whether a stop was set is unknown"

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
_MARK_REPORTED = "UPDATE begun SET way = '' WHERE outcome = '' AND way <> '' AND robot = ?"
_END = "UPDATE begun SET outcome = ? WHERE robot = ? AND identity = ?"
_LATCH = "INSERT OR REPLACE INTO latch VALUES (?, ?)"
_RECOVERED = {StartedCommand: _RECOVER, Latched: _LATCH}
_FORGET = "DELETE FROM begun WHERE stamp < ?"


class JournalFile:
    """The open database; one thread at a time. Each method may raise sqlite3.Error.

    Opening writes the rows that processes ``left`` in their execution journals, a write without which a full
    disk would not be noticed. Where it is unknown which stops were set, every robot is stopped: the file was
    damaged, or a process marked that it could not write a stop. ``within``: seconds to wait for another
    process that opens it. Opening also raises StateError and OSError.
    """

    def __init__(
        self,
        folder: Path,
        left: AbstractContextManager[Iterable[JournalRow]],
        mark: UnwrittenMark,
        *,
        within: float = math.inf,
    ) -> None:
        path = create_folder(folder) / JOURNAL
        with locked(path, within=within):
            self._database, aside = open_checked(path, FORMATS, "FULL")
            try:
                marks = mark.others
                unknown = [Latched(ANY, LOST)] if aside is not None or marks else []
                with left as rows:
                    self._recover([*unknown, *rows])
            except BaseException:
                self._database.close()
                raise
            remove(marks)

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def commit(self, changes: NetChanges, now: float) -> None:
        """Write changes in one synchronised transaction; ``now`` is Unix seconds.

        Commands are written many per call: each call releases and reacquires the interpreter lock, for which
        a command on its transport to a robot would have to wait.
        """
        with transaction(self._database):
            self._database.executemany(_END, map(msgspec.structs.astuple, changes.ended.values()))
            every_row = [
                (*msgspec.structs.astuple(started), how) for started, how in changes.commands.values()
            ]
            for start in range(0, len(every_row), _AT_ONCE):
                rows = every_row[start : start + _AT_ONCE]
                values = itertools.chain.from_iterable(rows)
                self._database.execute(_BEGIN + ", ".join([_ROW] * len(rows)), tuple(values))
            self._database.executemany(_LATCH, changes.latches.items())
            self._database.execute(_FORGET, (now - REMEMBERED,))

    def latched(self, robot: str) -> str:
        """Return the cause of a robot's emergency stop; empty if it is not set."""
        query = "SELECT robot, why FROM latch WHERE robot IN (?, ?)"
        latches: dict[str, str] = dict(self._database.execute(query, (robot, ANY)))
        return latches.get(robot, latches.get(ANY, ""))

    def past(self, robot: str, now: float) -> list[PastCommand]:
        """Return a robot's remembered commands, oldest first."""
        rows = self._database.execute(
            "SELECT identity, name, action, outcome FROM begun WHERE robot = ? AND stamp >= ? "
            "ORDER BY stamp DESC LIMIT ?",
            (robot, now - REMEMBERED, KEPT),
        )
        past = [
            PastCommand(identity, command, bool(action), outcome)
            for identity, command, action, outcome in rows
        ]
        return past[::-1]

    def take_interrupted(self, robot: str, now: float) -> list[InterruptedCommand]:
        """Return the commands of a robot without a known end, and mark them as reported."""
        rows = self._database.execute(_INTERRUPTED, (robot, now - REMEMBERED)).fetchall()
        self._database.execute(_MARK_REPORTED, (robot,))
        return [InterruptedCommand(*row) for row in rows]

    def _recover(self, rows: Iterable[JournalRow]) -> None:
        """Write rows of execution journals; writes even without any, because a full disk can be read."""
        with transaction(self._database):
            self._database.execute(_LATCH, ("", ""))
            self._database.execute("DELETE FROM latch WHERE robot = ''")
            for row in rows:
                if isinstance(row, Latched) and row.robot == ANY:  # earlier releases do not count
                    self._database.execute("DELETE FROM latch WHERE why = ''")
                self._database.execute(_RECOVERED[type(row)], msgspec.structs.astuple(row))
