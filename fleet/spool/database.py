"""Opening an SQLite file so that what is wrong with it costs its content at most, never the edge."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from pathlib import Path
from typing import Literal

from fleet.errors import StateError

log = logging.getLogger(__name__)

PAGE = 4096
"""Bytes of one page of the file."""
BUSY = 2.0
"""Seconds to wait for another process that writes."""
BROKEN = ".broken"
"""What a file that cannot be read is renamed to; only the newest of them is kept."""

Synchronous = Literal["NORMAL", "FULL"]
"""NORMAL survives the death of the process; FULL also that of the computer, but waits for the disk."""


def is_corrupt(error: sqlite3.Error) -> bool:
    """Return True when the file itself is damaged, rather than the disk full or the file locked."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def set_aside(path: Path) -> Path:
    """Rename a damaged file, and what belongs to it; return its new place. Raises OSError."""
    for part in ("-wal", "-shm"):
        with contextlib.suppress(FileNotFoundError):
            path.with_name(path.name + part).replace(path.with_name(path.name + BROKEN + part))
    aside = path.with_name(path.name + BROKEN)
    path.replace(aside)
    return aside


def open_checked(
    path: Path, schema: str, version: int, synchronous: Synchronous, *, busy: float = BUSY
) -> tuple[sqlite3.Connection, Path | None]:
    """Open a file, or make it; one that is damaged, or of another version, is set aside and a new one made.

    Returns the connection, for use on any one thread at a time, and where the old file is now, None when
    it was well. ``busy``: seconds that a statement waits for another process that writes. Raises StateError
    when neither the old nor a new file can be used.
    """
    try:
        try:
            return _opened(path, schema, version, synchronous, busy), None
        except sqlite3.DatabaseError as error:
            if not (is_corrupt(error) or isinstance(error, _Damaged)):
                raise
            aside = set_aside(path)
            log.error("%s cannot be read (%s): set aside as %s", path, error, aside.name)  # noqa: TRY400
            return _opened(path, schema, version, synchronous, busy), aside
    except (sqlite3.Error, OSError) as error:
        raise StateError(f"{path} cannot be used: {error}; set edge.spool.path, or mend the disk") from None


class _Damaged(sqlite3.DatabaseError):
    """The file opens but is not what we wrote."""


def _opened(
    path: Path, schema: str, version: int, synchronous: Synchronous, busy: float
) -> sqlite3.Connection:
    """Open a file and check it, or make it, for this user alone: its folder may be open to others."""
    path.touch(mode=0o600)
    connection = sqlite3.connect(path, timeout=busy, isolation_level=None, check_same_thread=False)
    try:
        connection.execute(f"PRAGMA page_size = {PAGE}")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute(f"PRAGMA synchronous = {synchronous}")
        if _found(connection, version) == 0:
            connection.executescript(f"BEGIN; {schema}; PRAGMA user_version = {version}; COMMIT")
    except BaseException:
        connection.close()
        raise
    return connection


def _found(connection: sqlite3.Connection, version: int) -> int:
    """Return the version of what is in the file, 0 for nothing; raises _Damaged for what is not ours."""
    found = int(connection.execute("PRAGMA user_version").fetchone()[0])
    verdict = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    if verdict != "ok":
        raise _Damaged(str(verdict))
    if found not in (0, version):
        raise _Damaged(f"version {found}, not {version}")
    return found
