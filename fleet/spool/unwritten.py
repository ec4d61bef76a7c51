"""Messages that are not on disk yet, in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from fleet.spool.message import Outgoing

GRACE = 0.2
"""Seconds that the cloud has to acknowledge a message before it is written to disk, while connected."""
MOST_ROWS = 2000
"""Most messages of one transaction: bounds its time and memory."""
MOST_TOMBSTONES = 500
"""Gone messages above which they are removed once they are the majority.

While a disk hangs for long, new messages may displace many old ones.
"""


class UnwrittenMessages:
    """The messages to write next."""

    def __init__(self) -> None:
        self._messages: deque[Outgoing] = deque()
        self._tombstones = 0

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[Outgoing]:
        return iter(self._messages)

    def add(self, message: Outgoing) -> None:
        """Add a message."""
        self._messages.append(message)

    def tombstone(self) -> None:
        """Record that one of the messages is ``gone``."""
        self._tombstones += 1
        if self._tombstones > MOST_TOMBSTONES and 2 * self._tombstones > len(self._messages):
            self._messages = deque(message for message in self._messages if not message.gone)
            self._tombstones = 0

    def take(self, now: float, *, at_once: bool) -> list[Outgoing]:
        """Remove and return messages to write, oldest first, bounded in number; mark them ``stored``.

        Those are the messages older than GRACE, or all if ``at_once``.
        """
        rows: list[Outgoing] = []
        while self._messages and len(rows) < MOST_ROWS:
            if not (at_once or self._messages[0].since + GRACE <= now):
                break
            message = self._messages.popleft()
            if message.gone:
                self._tombstones -= 1
                continue
            message.stored = True
            rows.append(message)
        return rows

    def requeue(self, rows: Sequence[Outgoing]) -> None:
        """Take back messages that could not be written."""
        for message in reversed(rows):
            message.stored = False
            if not message.gone:
                self._messages.appendleft(message)
