"""Opens SQLite files such that a damaged file costs its content at most, never the edge."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from fleet.errors import StateError, StateNewer
from fleet.runtime.state_format import refuse_newer

log = logging.getLogger(__name__)

PAGE = 4096
"""Page size of the file, bytes."""
CACHE = 512
"""Page cache of a connection, KiB; SQLite's default of 2,000 would fill up in every file over hours."""
BUSY = 2.0
"""Seconds to wait for a write of another process."""
BROKEN = ".broken"
"""Suffix of a damaged file when it is set aside; only the newest one is kept."""
NEWER = ".format-{}"
"""Suffix of a file of a newer fleet when it is set aside; that fleet can use it again."""

Synchronous = Literal["NORMAL", "FULL"]
"""NORMAL survives the death of the process; FULL also that of the computer, but waits for the disk."""


def is_corrupt(error: sqlite3.Error) -> bool:
    """Return True if the file is damaged, as opposed to a full disk or a locked file."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def set_aside(path: Path, suffix: str = BROKEN) -> Path:
    """Rename a file that cannot be used, with its WAL and shared memory; return the new path.

    Raises OSError.
    """
    for part in ("-wal", "-shm"):
        with contextlib.suppress(FileNotFoundError):
            path.with_name(path.name + part).replace(path.with_name(path.name + suffix + part))
    aside = path.with_name(path.name + suffix)
    path.replace(aside)
    return aside


def open_checked(
    path: Path, formats: Sequence[str], synchronous: Synchronous, *, busy: float = BUSY
) -> tuple[sqlite3.Connection, Path | None]:
    """Open or create a file; one that is damaged or of a newer format is set aside and replaced.

    ``formats`` is the SQL that migrates a file from each format number to the next, from 0, an empty file.
    Returns the connection, for use on one thread at a time, and the path of the file that was set aside, None
    if the file was intact. ``busy``: seconds that a statement waits for a write of another process. Raises
    StateError when neither the old nor a new file can be used.
    """
    try:
        try:
            return _opened(path, formats, synchronous, busy), None
        except (sqlite3.DatabaseError, StateNewer) as error:
            aside = set_aside(path, _suffix(error))
            log.error("%s cannot be read (%s): set aside as %s", path, error, aside.name)  # noqa: TRY400
            return _opened(path, formats, synchronous, busy), aside
    except (sqlite3.Error, OSError) as error:
        raise StateError(f"{path} cannot be used: {error}; set edge.spool.path, or repair the disk") from None


class _Damaged(sqlite3.DatabaseError):
    """The file opens, but its content is not ours."""


def _suffix(error: sqlite3.DatabaseError | StateNewer) -> str:
    """Return the suffix for a file that is set aside; raise errors for which it stays in place."""
    if isinstance(error, StateNewer):
        return NEWER.format(error.found)
    if is_corrupt(error) or isinstance(error, _Damaged):
        return BROKEN
    raise error


@contextlib.contextmanager
def transaction(database: sqlite3.Connection) -> Iterator[None]:
    """Run a ``with`` block as one transaction, which an exception or a failed commit rolls back."""
    database.execute("BEGIN IMMEDIATE")
    try:
        yield
        database.execute("COMMIT")
    except BaseException:
        with contextlib.suppress(sqlite3.Error):  # SQLite may have rolled it back already
            database.execute("ROLLBACK")
        raise


def format_of(connection: sqlite3.Connection, newest: int) -> int:
    """Return the format number of a file, 0 for an empty one; raises StateNewer."""
    found = int(connection.execute("PRAGMA user_version").fetchone()[0])
    refuse_newer(found, newest)
    return found


def _opened(path: Path, formats: Sequence[str], synchronous: Synchronous, busy: float) -> sqlite3.Connection:
    """Open and check a file, or create it with access for this user only."""
    path.touch(mode=0o600)
    connection = sqlite3.connect(path, timeout=busy, isolation_level=None, check_same_thread=False)
    try:
        found = format_of(connection, len(formats))  # before any change to the file
        connection.execute(f"PRAGMA page_size = {PAGE}")
        connection.execute(f"PRAGMA cache_size = -{CACHE}")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(f"PRAGMA synchronous = {synchronous}")
        _check(connection, found)
        if found < len(formats):
            steps = "; ".join(formats[found:])
            connection.executescript(f"BEGIN; {steps}; PRAGMA user_version = {len(formats)}; COMMIT")
    except BaseException:
        connection.close()
        raise
    return connection


def _check(connection: sqlite3.Connection, found: int) -> None:
    """Raise _Damaged for a file that fails SQLite's check or has an invalid format number."""
    verdict = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    if verdict != "ok":
        raise _Damaged(str(verdict))
    if found < 0:
        raise _Damaged(f"format {found}")
