"""The file of a spool: rows in transactions. Every method does I/O and may raise sqlite3.Error."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from fleet.spool.database import PAGE, open_checked, transaction
from fleet.spool.losses import Gap, Reason
from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass

LEAST_EVICTED = 200
"""Messages removed at once to make room, so that it is not done for each new one."""
FULL_AT, ROOM_AT = 0.9, 0.89
"""Shares of the byte budget: above the first, messages are removed until the second is reached.

They are close together, because nothing is written during a removal.
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
"""SQL that creates the file, and migrates it from each format number to the next."""
_SELECT = "SELECT message.seq, topic.name FROM message JOIN topic ON topic.id = message.topic "
_OLDEST = _SELECT + "WHERE topic.traffic = ? AND message.seq >= ? ORDER BY message.seq LIMIT ?"
_FIRST = (
    "SELECT traffic, min(first) FROM "
    "(SELECT traffic, (SELECT min(seq) FROM message WHERE message.topic = topic.id) AS first FROM topic) "
    "WHERE first IS NOT NULL GROUP BY traffic ORDER BY traffic DESC LIMIT 1"
)
"""The least important class in the file, and its oldest message: one index lookup for each topic."""
_LATE = _SELECT + "WHERE message.expires <= ? LIMIT ?"


class StoredTopic(msgspec.Struct, frozen=True):
    """The stored messages of one topic: their count, and the numbers of the oldest and the newest."""

    topic: str
    traffic: TrafficClass
    count: int
    oldest: int
    newest: int


class SpoolFile:
    """The file of one spool, of at most ``size`` bytes.

    ``aside``: path of a damaged one that was set aside.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self.aside: Path | None
        self._database, self.aside = open_checked(path, FORMATS, "NORMAL")
        self._pages = size // PAGE
        self._database.execute(f"PRAGMA max_page_count = {self._pages}")
        self._database.execute("PRAGMA journal_size_limit = 4194304")
        self._database.execute("DELETE FROM topic WHERE id NOT IN (SELECT topic FROM message)")
        self._ids = self._known_ids()
        self.used = 0  # bytes in use
        self._used()

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def left(self) -> list[StoredTopic]:
        """Return the stored topics."""
        rows = self._database.execute(
            "SELECT topic.name, topic.traffic, count(*), min(message.seq), max(message.seq) FROM message "
            "JOIN topic ON topic.id = message.topic GROUP BY topic.id"
        )
        return [StoredTopic(topic, TrafficClass(traffic), *rest) for topic, traffic, *rest in rows]

    def losses(self) -> list[Gap]:
        """Return the losses that have not been reported yet."""
        rows = self._database.execute("SELECT topic, reason, lost, since, until FROM loss")
        return [Gap(topic, Reason(reason), *rest) for topic, reason, *rest in rows]

    def change(
        self, rows: Iterable[Outgoing], done: Iterable[int], losses: Iterable[Gap] | None = None
    ) -> None:
        """Insert messages, delete others and replace the losses, in one transaction."""
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
        """Return whether ``size`` more bytes are within the budget."""
        return self._used() + size / PAGE < FULL_AT * self._pages

    def evict(self, size: int) -> Iterator[list[tuple[str, int]]]:
        """Remove the oldest, least important messages until ``size`` bytes fit; yield topics and numbers.

        It works in parts, because the memory for all of them would grow with the file.
        """
        while self._used() + size / PAGE > ROOM_AT * self._pages:
            with self._transaction():
                removed = self._remove(self._oldest())
            if not removed:
                break
            yield removed

    def expire(self, wall: float) -> list[tuple[str, int]]:
        """Remove a part of the expired messages; return topics and numbers."""
        late = self._database.execute(_LATE, (wall, 5 * LEAST_EVICTED)).fetchall()
        with self._transaction():
            return self._remove(late)

    def postpone(self, seconds: float, after: int) -> None:
        """Move the expiry of messages with numbers above ``after`` by ``seconds``."""
        with self._transaction():
            self._database.execute("UPDATE message SET expires = expires + ? WHERE seq > ?", (seconds, after))

    def checkpoint(self) -> None:
        """Write the WAL to the medium, so that a power cut loses none of it."""
        self._database.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()

    def _oldest(self) -> list[tuple[int, str]]:
        """Return the oldest messages of the least important class, without reading all messages."""
        least = self._database.execute(_FIRST).fetchone()
        return self._database.execute(_OLDEST, (*least, LEAST_EVICTED)).fetchall() if least else []

    def _remove(self, rows: Sequence[tuple[int, str]]) -> list[tuple[str, int]]:
        """Remove messages."""
        self._database.executemany("DELETE FROM message WHERE seq = ?", [(seq,) for seq, _ in rows])
        return [(topic, seq) for seq, topic in rows]

    def _used(self) -> int:
        """Return the number of pages in use."""
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
        """Return the ids of the topics by name."""
        return dict(self._database.execute("SELECT name, id FROM topic"))

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        """Run a ``with`` block as one transaction; when it fails, its new topics are forgotten, too."""
        try:
            with transaction(self._database):
                yield
        except BaseException:
            with contextlib.suppress(sqlite3.Error):
                self._ids = self._known_ids()
            raise
