"""The spool's file: rows in, rows out, in transactions; every method does I/O and may raise sqlite3.Error."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from fleet.spool.database import PAGE, open_checked
from fleet.spool.losses import Gap, Reason
from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass

LEAST_EVICTED = 200
"""Messages that are removed at once to make room, so that it is not done for each."""
FULL_AT, ROOM_AT = 0.9, 0.89
"""Parts of the byte budget: above the first messages are removed until it is below the second.

They are near each other: while some are removed none is written.
"""

FORMATS = (
    """
CREATE TABLE topic (id INTEGER PRIMARY KEY, name TEXT UNIQUE, traffic INTEGER);
CREATE TABLE message (
    seq INTEGER PRIMARY KEY, topic INTEGER, expires REAL, payload BLOB, correlation BLOB, content_type TEXT
);
CREATE INDEX message_by_topic ON message (topic, seq);
CREATE TABLE loss (
    topic TEXT, reason TEXT, lost INTEGER, since REAL, until REAL, PRIMARY KEY (topic, reason)
);
""",
)
"""What makes the file, and brings it from each format number to the next."""
_SELECT = "SELECT message.seq, topic.name FROM message JOIN topic ON topic.id = message.topic "
_OLDEST = _SELECT + "WHERE topic.traffic = ? AND message.seq >= ? ORDER BY message.seq LIMIT ?"
_FIRST = (
    "SELECT traffic, min(first) FROM "
    "(SELECT traffic, (SELECT min(seq) FROM message WHERE message.topic = topic.id) AS first FROM topic) "
    "WHERE first IS NOT NULL GROUP BY traffic ORDER BY traffic DESC LIMIT 1"
)
"""The least important traffic that there is, and its oldest message: by the index, a look for each topic."""
_LATE = _SELECT + "WHERE message.expires <= ? LIMIT ?"


class StoredTopic(msgspec.Struct, frozen=True):
    """What a file holds of one topic: how many messages, and the numbers of the oldest and the newest."""

    topic: str
    traffic: TrafficClass
    count: int
    oldest: int
    newest: int


class SpoolFile:
    """The file of one spool, of at most ``size`` bytes. ``aside``: where a damaged one is now."""

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self.aside: Path | None
        self._database, self.aside = open_checked(path, FORMATS, "NORMAL")
        self._pages = size // PAGE
        self._database.execute(f"PRAGMA max_page_count = {self._pages}")
        self._database.execute("PRAGMA journal_size_limit = 4194304")
        self._database.execute("DELETE FROM topic WHERE id NOT IN (SELECT topic FROM message)")
        self._ids = self._known_ids()
        self.used = 0  # bytes that hold something
        self._used()

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def left(self) -> list[StoredTopic]:
        """Return what the file holds."""
        rows = self._database.execute(
            "SELECT topic.name, topic.traffic, count(*), min(message.seq), max(message.seq) FROM message "
            "JOIN topic ON topic.id = message.topic GROUP BY topic.id"
        )
        return [StoredTopic(topic, TrafficClass(traffic), *rest) for topic, traffic, *rest in rows]

    def losses(self) -> list[Gap]:
        """Return the losses that nobody has been told of."""
        rows = self._database.execute("SELECT topic, reason, lost, since, until FROM loss")
        return [Gap(topic, Reason(reason), *rest) for topic, reason, *rest in rows]

    def change(
        self, rows: Iterable[Outgoing], done: Iterable[int], losses: Iterable[Gap] | None = None
    ) -> None:
        """Add messages, remove others and keep the losses, all or nothing."""
        with self._transaction():
            self._database.executemany(
                "INSERT INTO message VALUES (?, ?, ?, ?, ?, ?)", [self._row(message) for message in rows]
            )
            self._database.executemany("DELETE FROM message WHERE seq = ?", [(seq,) for seq in done])
            if losses is not None:
                self._database.execute("DELETE FROM loss")
                self._database.executemany(
                    "INSERT INTO loss VALUES (?, ?, ?, ?, ?)", map(msgspec.structs.astuple, losses)
                )
        self._used()

    def fetch(self, topic: str, after: int, limit: int, traffic: TrafficClass) -> list[Outgoing]:
        """Return the oldest messages of a topic that are newer than ``after``."""
        rows = self._database.execute(
            "SELECT seq, expires, payload, correlation, content_type FROM message "
            "WHERE topic = ? AND seq > ? ORDER BY seq LIMIT ?",
            (self._ids.get(topic, 0), after, limit),
        )
        return [
            Outgoing(
                topic,
                payload,
                1,
                traffic,
                correlation=correlation,
                content_type=content_type,
                expires=expires,
                seq=seq,
                stored=True,
            )
            for seq, expires, payload, correlation, content_type in rows
        ]

    def room(self, size: int) -> bool:
        """Tell whether ``size`` more bytes stay within the budget."""
        return self._used() + size / PAGE < FULL_AT * self._pages

    def evict(self, size: int) -> Iterator[list[tuple[str, int]]]:
        """Remove the oldest of what matters least until ``size`` bytes fit; yield topics and numbers.

        It is done in parts: what all of it would take in memory grows with the file.
        """
        while self._used() + size / PAGE > ROOM_AT * self._pages:
            with self._transaction():
                removed = self._remove(self._oldest())
            if not removed:
                break
            yield removed

    def expire(self, wall: float) -> list[tuple[str, int]]:
        """Remove what is too old, a part at a time; return topics and numbers."""
        late = self._database.execute(_LATE, (wall, 5 * LEAST_EVICTED)).fetchall()
        with self._transaction():
            return self._remove(late)

    def postpone(self, seconds: float, after: int) -> None:
        """Have messages with numbers beyond ``after`` grow too old later by so many seconds, or earlier."""
        with self._transaction():
            self._database.execute("UPDATE message SET expires = expires + ? WHERE seq > ?", (seconds, after))

    def checkpoint(self) -> None:
        """Have everything on the medium itself, so that a power cut loses nothing of it."""
        self._database.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()

    def _oldest(self) -> list[tuple[int, str]]:
        """Return the oldest of the least important traffic that there is; without reading all that waits."""
        least = self._database.execute(_FIRST).fetchone()
        return self._database.execute(_OLDEST, (*least, LEAST_EVICTED)).fetchall() if least else []

    def _remove(self, rows: Sequence[tuple[int, str]]) -> list[tuple[str, int]]:
        """Remove messages."""
        self._database.executemany("DELETE FROM message WHERE seq = ?", [(seq,) for seq, _ in rows])
        return [(topic, seq) for seq, topic in rows]

    def _used(self) -> int:
        """Return how many pages hold something."""
        pages = self._database.execute("PRAGMA page_count").fetchone()[0]
        used = int(pages - self._database.execute("PRAGMA freelist_count").fetchone()[0])
        self.used = used * PAGE
        return used

    def _row(self, message: Outgoing) -> tuple[object, ...]:
        """Return a message as a row."""
        topic = self._ids.get(message.topic)
        if topic is None:
            topic = self._database.execute(
                "INSERT INTO topic (name, traffic) VALUES (?, ?)", (message.topic, message.traffic)
            ).lastrowid
            self._ids[message.topic] = topic or 0
        return (
            message.seq,
            topic,
            message.expires,
            message.payload,
            message.correlation,
            message.content_type,
        )

    def _known_ids(self) -> dict[str, int]:
        """Return the numbers that stand for topics."""
        return dict(self._database.execute("SELECT name, id FROM topic"))

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        """Do all of a ``with`` block or nothing of it."""
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._database.execute("COMMIT")
        except BaseException:
            with contextlib.suppress(sqlite3.Error):
                self._database.execute("ROLLBACK")
            with contextlib.suppress(sqlite3.Error):
                self._ids = self._known_ids()
            raise
