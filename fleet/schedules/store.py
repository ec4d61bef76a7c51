"""Store of firings: an SQLite file beside the journal. A firing is stored before it is started.

Data is on disk when a call returns; otherwise the call raises StateError, also after ``close``. For any
thread.
"""

from __future__ import annotations

import contextlib
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from fleet.errors import StateError
from fleet.model.schedule import Firing
from fleet.spool.database import open_checked, transaction

FILE = "schedules.db"
KEPT = 1000  # firings of each schedule
_TABLES = """
CREATE TABLE schedule (name TEXT PRIMARY KEY, digest TEXT, seen REAL, enabled INTEGER);
CREATE TABLE firing (
    schedule TEXT, due REAL, state TEXT, reason TEXT, run TEXT, recorded REAL, PRIMARY KEY (schedule, due)
);
"""
FORMATS = (_TABLES,)
DUE, STARTED, SKIPPED = "due", "started", "skipped"


class FiringStore:
    """The firings of an edge's schedules, and the schedules enabled or disabled by hand."""

    def __init__(self, folder: Path) -> None:
        # SQLite crashes the process if one thread closes a connection that another uses
        self._using = threading.Lock()
        self._database, self.set_aside = open_checked(folder / FILE, FORMATS, "FULL")

    def close(self) -> None:
        """Close the file."""
        with self._using:
            self._database.close()

    def seen(self, name: str, digest: str, now: float) -> float:
        """Return the instant up to which the firings of a schedule are handled.

        A schedule that is new or has changed starts now: earlier firings are not due.
        """
        with self._writing() as database:
            row = database.execute("SELECT digest, seen FROM schedule WHERE name = ?", (name,)).fetchone()
            if row is not None and row[0] == digest:
                return float(row[1])
            database.execute(
                "INSERT INTO schedule (name, digest, seen) VALUES (?1, ?2, ?3) "
                "ON CONFLICT (name) DO UPDATE SET digest = ?2, seen = ?3",
                (name, digest, now),
            )
            return now

    def record(self, name: str, firings: Sequence[Firing], seen: float) -> list[Firing]:
        """Write firings and the instant of the check in one transaction; return the new ones."""
        new = []
        with self._writing() as database:
            for one in firings:
                done = database.execute(
                    "INSERT OR IGNORE INTO firing VALUES (?, ?, ?, ?, ?, ?)",
                    msgspec.structs.astuple(one),
                )
                new += [one] if done.rowcount else []
            database.execute("UPDATE schedule SET seen = max(seen, ?) WHERE name = ?", (seen, name))
            database.execute(
                "DELETE FROM firing WHERE schedule = ?1 AND state <> 'due' AND due < (SELECT due FROM firing "
                "WHERE schedule = ?1 ORDER BY due DESC LIMIT 1 OFFSET ?2)",
                (name, KEPT),
            )
        return new

    def end(self, firing: Firing) -> bool:
        """Write the result of a firing; return True if it was known."""
        with self._writing() as database:
            done = database.execute(
                "UPDATE firing SET state = ?, reason = ?, run = ? WHERE schedule = ? AND due = ?",
                (firing.state, firing.reason, firing.run, firing.schedule, firing.due),
            )
            return done.rowcount == 1

    def open(self) -> list[Firing]:
        """Return the firings without a result, oldest first."""
        return self._firings("WHERE state = ? ORDER BY due", (DUE,))

    def last(self, name: str, number: int = 1) -> list[Firing]:
        """Return the newest firings of a schedule, newest first."""
        return self._firings("WHERE schedule = ? ORDER BY due DESC LIMIT ?", (name, number))

    def enabled(self) -> dict[str, bool]:
        """Return the schedules enabled or disabled by hand."""
        with self._writing() as database:
            rows = database.execute("SELECT name, enabled FROM schedule WHERE enabled IS NOT NULL")
            return {name: bool(enabled) for name, enabled in rows}

    def enable(self, name: str, now: float, *, enabled: bool) -> None:
        """Enable or disable a schedule; firings due while it was disabled are not made up for."""
        with self._writing() as database:
            database.execute(
                "UPDATE schedule SET enabled = ?, seen = max(seen, ?) WHERE name = ?", (enabled, now, name)
            )

    def _firings(self, which: str, values: Sequence[object]) -> list[Firing]:
        """Return firings selected by an SQL clause."""
        with self._writing() as database:
            rows = database.execute(f"SELECT * FROM firing {which}", values)  # noqa: S608 - constant
            return [Firing(*row) for row in rows]

    @contextlib.contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Run a block in one transaction; raises StateError."""
        database = self._database
        try:
            with self._using, transaction(database):
                yield database
        except sqlite3.Error as error:
            raise StateError(f"{FILE} cannot be used: {error}") from None
