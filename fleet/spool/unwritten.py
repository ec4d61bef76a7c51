"""The messages that are not on disk yet, in their order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from fleet.spool.message import Outgoing

GRACE = 0.2
"""Seconds in which the cloud may take a message before it is written to disk, while connected."""
AT_ONCE = 2000
"""Messages that one transaction writes at most: what it takes in time and memory is bounded."""
FORSAKEN = 500
"""Messages that nobody waits for any more, above which they are thrown out as soon as they are the most.

A disk may hang for long while messages come and are pushed out by newer ones.
"""


class UnwrittenMessages:
    """What goes to disk next."""

    def __init__(self) -> None:
        self._messages: deque[Outgoing] = deque()
        self._forsaken = 0

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[Outgoing]:
        return iter(self._messages)

    def add(self, message: Outgoing) -> None:
        """Add a message."""
        self._messages.append(message)

    def tombstone(self) -> None:
        """Note that nobody waits for one of them any more (it is ``gone``)."""
        self._forsaken += 1
        if self._forsaken > FORSAKEN and 2 * self._forsaken > len(self._messages):
            self._messages = deque(message for message in self._messages if not message.gone)
            self._forsaken = 0

    def take(self, now: float, *, at_once: bool) -> list[Outgoing]:
        """Remove and return what is to be written now, ``stored`` from now on: some of it, the oldest first.

        That is what has waited for GRACE, or all ``no_wait``.
        """
        rows: list[Outgoing] = []
        while self._messages and len(rows) < AT_ONCE:
            if not (at_once or self._messages[0].since + GRACE <= now):
                break
            message = self._messages.popleft()
            if message.gone:
                self._forsaken -= 1
                continue
            message.stored = True
            rows.append(message)
        return rows

    def put_back(self, rows: Sequence[Outgoing]) -> None:
        """Take back what could not be written."""
        for message in reversed(rows):
            message.stored = False
            if not message.gone:
                self._messages.appendleft(message)
