"""Looking into a spool's file from outside, while its edge runs or not; and emptying one that nobody uses."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import msgspec

from fleet.errors import StateError
from fleet.spool.losses import Gap, Reason
from fleet.spool.place import SPOOL, Lock
from fleet.spool.store import SCHEMA
from fleet.wire.rules import Traffic


class Waiting(msgspec.Struct, frozen=True):
    """What waits on one topic; ``bytes`` of payload, ``expires`` (Unix s) the first of it."""

    topic: str
    traffic: str
    messages: int
    bytes: int
    expires: float


class Kept(msgspec.Struct, frozen=True):
    """One message as it waits; ``expires`` is Unix time."""

    seq: int
    topic: str
    traffic: str
    expires: float
    payload: bytes


def waiting(folder: Path) -> list[Waiting]:
    """Return what waits, by topic, what matters most first. Raises StateError."""
    with _opened(folder) as database:
        rows = database.execute(
            "SELECT topic.name, topic.traffic, count(*), sum(length(payload)), min(expires) FROM message "
            "JOIN topic ON topic.id = message.topic GROUP BY topic.id ORDER BY topic.traffic, topic.name"
        ).fetchall()
    return [Waiting(topic, Traffic(traffic).name.lower(), *rest) for topic, traffic, *rest in rows]


def untold(folder: Path) -> list[Gap]:
    """Return the losses that nobody was told of. Raises StateError."""
    with _opened(folder) as database:
        rows = database.execute(
            "SELECT topic, reason, lost, since, until FROM loss ORDER BY topic"
        ).fetchall()
    return [Gap(topic, Reason(reason), *rest) for topic, reason, *rest in rows]


def messages(folder: Path) -> Iterator[Kept]:
    """Yield what waits, the oldest first. Raises StateError."""
    with _opened(folder) as database:
        rows = database.execute(
            "SELECT seq, topic.name, topic.traffic, expires, payload FROM message "
            "JOIN topic ON topic.id = message.topic ORDER BY seq"
        )
        for seq, topic, traffic, expires, payload in rows:
            yield Kept(seq, topic, Traffic(traffic).name.lower(), expires, payload)


def in_use(folder: Path) -> bool:
    """Return True while an edge has the spool."""
    if not folder.is_dir():
        return False
    lock = Lock(folder / SPOOL)
    try:
        lock.take()
    except StateError:
        return True
    lock.let_go()
    return False


def purge(folder: Path) -> int:
    """Delete all that waits, and the losses; return how many messages.

    Raises StateError while an edge runs.
    """
    if not (folder / SPOOL).exists():
        return 0
    lock = Lock(folder / SPOOL)
    lock.take()
    try:
        with _opened(folder, mode="rw") as database:
            deleted = database.execute("DELETE FROM message").rowcount
            database.execute("DELETE FROM loss")
            database.execute("VACUUM")
    finally:
        lock.let_go()
    return deleted


@contextlib.contextmanager
def _opened(folder: Path, mode: str = "ro") -> Iterator[sqlite3.Connection]:
    """Open the file of a folder; one that is not there is empty."""
    path = folder / SPOOL
    try:
        if not path.exists():
            with contextlib.closing(sqlite3.connect(":memory:")) as nothing:
                nothing.executescript(SCHEMA)
                yield nothing
            return
        with contextlib.closing(
            sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, isolation_level=None)
        ) as database:
            yield database
    except sqlite3.Error as error:
        raise StateError(f"{path} cannot be read: {error}") from None
