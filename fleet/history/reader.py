"""Reader of an edge's history file; the edge may be running or not."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from fleet.errors import StateError, StateNewer
from fleet.history.event_filter import MOST, EventFilter
from fleet.history.record import COLUMNS, Record, record_of
from fleet.history.store import FORMATS, HISTORY
from fleet.spool.database import format_of


def read(folder: Path, wanted: EventFilter) -> list[Record]:
    """Return the selected events of a folder's file, the oldest first; none if missing. Raises StateError."""
    path = folder / HISTORY
    if not path.exists():
        return []
    try:
        with _opened(path) as database:
            if _is_new(database):
                return []
            return list(_records(database, wanted))[::-1]
    except (sqlite3.Error, OSError, StateNewer) as error:
        raise StateError(f"{path} cannot be read: {error}") from None


def _is_new(database: sqlite3.Connection) -> bool:
    """Return True for a file without tables: an edge is about to create them."""
    return database.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone() is None


def _records(database: sqlite3.Connection, wanted: EventFilter) -> Iterator[Record]:
    """Yield the selected events, the newest first; an invalid row is skipped."""
    marks = ", ".join("?" * len(wanted.robots))
    whose = f" AND robot IN ({marks})" if wanted.robots else ""
    requested = f"SELECT {COLUMNS} FROM event WHERE stamp >= ?{whose} ORDER BY stamp DESC, id DESC LIMIT ?"  # noqa: S608
    values = (wanted.since, *wanted.robots, max(1, min(wanted.most, MOST)))
    for row in database.execute(requested, values):
        with contextlib.suppress(ValueError):
            yield record_of(row)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a file for reading; on a read-only disk in SQLite's immutable mode."""
    address = f"{path.absolute().as_uri()}?mode=ro"
    with contextlib.ExitStack() as closing:
        for each in (address, f"{address}&immutable=1"):
            database = sqlite3.connect(each, uri=True, timeout=2.0)
            closing.callback(database.close)
            try:
                format_of(database, len(FORMATS))
                _is_new(database)
            except sqlite3.OperationalError:
                if each != address:
                    raise
            else:
                break
        yield database
