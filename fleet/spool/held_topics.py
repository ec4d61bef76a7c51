"""The topics that nobody hears, and when each is tried again."""

from __future__ import annotations

from fleet.spool.topic_queue import OPEN, TopicEvent, TopicQueue

FIRST_WAIT = 1.0
"""Seconds that a topic is held which nobody hears, doubled each time."""
LONGEST_WAIT = 15.0


class HeldTopics:
    """Lines in the state HELD; times are monotonic seconds."""

    def __init__(self) -> None:
        self._lines: dict[str, TopicQueue] = {}

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def messages(self) -> int:
        """How many messages wait in all of them."""
        return sum(line.waiting for line in self._lines.values())

    def unheard(self, line: TopicQueue, now: float) -> None:
        """Hold a line; the wait grows with the tries, not with the messages that were under way."""
        if line.see(TopicEvent.UNHEARD):
            line.retry = now + min(LONGEST_WAIT, FIRST_WAIT * 2**line.unheard)
            line.unheard = min(line.unheard + 1, 8)
            self._lines[line.topic] = line

    def heard(self, line: TopicQueue, now: float) -> None:
        """Take note that somebody heard; one who is back hears the other topics at once."""
        if line.state is OPEN:  # as nearly all are, nearly always
            return
        line.see(TopicEvent.HEARD)
        if line.unheard:
            line.unheard = 0
            for other in self._lines.values():
                other.retry = now

    def due(self, now: float) -> list[TopicQueue]:
        """Remove and return the lines that are to be tried again."""
        due = [line for line in self._lines.values() if line.retry <= now]
        for line in due:
            del self._lines[line.topic]
            line.see(TopicEvent.WAITED)
        return due

    def forget(self, line: TopicQueue) -> None:
        """Remove a line that is empty."""
        self._lines.pop(line.topic, None)

    def clear(self) -> None:
        """Forget all: a new connection asks anew."""
        self._lines.clear()
