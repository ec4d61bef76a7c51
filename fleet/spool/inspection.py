"""Read access to the file of a spool from another process, and its deletion while no edge uses it."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import msgspec

from fleet.errors import StateError, StateNewer, StateTaken
from fleet.spool.database import format_of
from fleet.spool.losses import Gap, Reason
from fleet.spool.state_folder import SPOOL, FileLock
from fleet.spool.store import FORMATS
from fleet.wire.rules import TrafficClass


class TopicBacklog(msgspec.Struct, frozen=True):
    """The waiting messages of one topic: ``bytes`` of payload, ``expires`` (Unix s) of the first."""

    topic: str
    traffic: str
    messages: int
    bytes: int
    expires: float


class QueuedMessage(msgspec.Struct, frozen=True):
    """One waiting message; ``expires`` is Unix time."""

    seq: int
    topic: str
    traffic: str
    expires: float
    payload: bytes


def backlog(folder: Path) -> list[TopicBacklog]:
    """Return the waiting messages by topic, the most important class first. Raises StateError."""
    with _opened(folder) as database:
        rows = database.execute(
            "SELECT topic.name, topic.traffic, count(*), sum(length(payload)), min(expires) FROM message "
            "JOIN topic ON topic.id = message.topic GROUP BY topic.id ORDER BY topic.traffic, topic.name"
        ).fetchall()
    return [TopicBacklog(topic, TrafficClass(traffic).name.lower(), *rest) for topic, traffic, *rest in rows]


def unreported_losses(folder: Path) -> list[Gap]:
    """Return the losses that have not been reported yet. Raises StateError."""
    with _opened(folder) as database:
        rows = database.execute(
            "SELECT topic, reason, lost, since, until FROM loss ORDER BY topic"
        ).fetchall()
    return [Gap(topic, Reason(reason), *rest) for topic, reason, *rest in rows]


def messages(folder: Path) -> Iterator[QueuedMessage]:
    """Yield the waiting messages, the oldest first. Raises StateError."""
    with _opened(folder) as database:
        rows = database.execute(
            "SELECT seq, topic.name, topic.traffic, expires, payload FROM message "
            "JOIN topic ON topic.id = message.topic ORDER BY seq"
        )
        for seq, topic, traffic, expires, payload in rows:
            yield QueuedMessage(seq, topic, TrafficClass(traffic).name.lower(), expires, payload)


def in_use(folder: Path) -> bool:
    """Return True while an edge uses the spool."""
    if not folder.is_dir():
        return False
    lock = FileLock(folder / SPOOL)
    try:
        lock.acquire()
    except StateTaken:
        return True
    except StateError:  # the lock's file does not exist and does not fit on a full disk: unused
        return False
    lock.release()
    return False


def purge(folder: Path) -> int:
    """Delete all waiting messages and losses; return the number of messages.

    Raises StateError while an edge runs.
    """
    if not (folder / SPOOL).exists():
        return 0
    lock = FileLock(folder / SPOOL)
    lock.acquire()
    try:
        with _opened(folder, mode="rw") as database:
            deleted = database.execute("DELETE FROM message").rowcount
            database.execute("DELETE FROM loss")
            database.execute("VACUUM")
    finally:
        lock.release()
    return deleted


@contextlib.contextmanager
def _opened(folder: Path, mode: str = "ro") -> Iterator[sqlite3.Connection]:
    """Open the file of a folder; a missing one counts as empty."""
    path = folder / SPOOL
    try:
        with contextlib.closing(_connected(path, mode)) as database:
            format_of(database, len(FORMATS))
            yield database
    except StateNewer as error:
        raise StateError(f"{path} cannot be read: {error}") from None
    except (sqlite3.Error, OSError) as error:
        raise StateError(f"{path} cannot be read: {error}; is its disk full?") from None


def _connected(path: Path, mode: str) -> sqlite3.Connection:
    """Return a connection to a file; one that is missing or has no bytes counts as empty."""
    if not path.exists() or not path.stat().st_size:
        nothing = sqlite3.connect(":memory:")
        nothing.executescript("; ".join(FORMATS))
        return nothing
    place = path.absolute().as_uri()
    database = sqlite3.connect(f"{place}?mode={mode}", uri=True, isolation_level=None)
    try:
        database.execute("PRAGMA schema_version").fetchone()
    except sqlite3.OperationalError:
        database.close()
        log = path.with_name(f"{path.name}-wal")
        if log.exists() and log.stat().st_size:
            raise
        # Readers need the WAL index (-shm), for which a full disk has no room. Without an index no other
        # process has the file open, and the WAL is empty, so the file can be read as immutable.
        database = sqlite3.connect(f"{place}?immutable=1", uri=True, isolation_level=None)
    return database
