"""Topics without a subscriber, and when each is retried."""

from __future__ import annotations

from fleet.spool.topic_queue import OPEN, TopicEvent, TopicQueue

FIRST_WAIT = 1.0
"""Seconds until a topic without a subscriber is retried, doubled each time."""
LONGEST_WAIT = 15.0


class HeldTopics:
    """Topic queues in the state HELD; times are monotonic seconds."""

    def __init__(self) -> None:
        self._lines: dict[str, TopicQueue] = {}

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def messages(self) -> int:
        """The number of waiting messages in all of them."""
        return sum(line.waiting for line in self._lines.values())

    def unheard(self, line: TopicQueue, now: float) -> None:
        """Hold a topic queue; the delay grows with each attempt, not with each message in flight."""
        if line.see(TopicEvent.UNHEARD):
            line.retry = now + min(LONGEST_WAIT, FIRST_WAIT * 2**line.unheard)
            line.unheard = min(line.unheard + 1, 8)
            self._lines[line.topic] = line

    def heard(self, line: TopicQueue, now: float) -> None:
        """Record that a topic has a subscriber; if it had none before, retry all held topics immediately."""
        if line.state is OPEN:  # the common case
            return
        line.see(TopicEvent.HEARD)
        if line.unheard:
            line.unheard = 0
            for other in self._lines.values():
                other.retry = now

    def due(self, now: float) -> list[TopicQueue]:
        """Remove and return the topic queues to retry."""
        due = [line for line in self._lines.values() if line.retry <= now]
        for line in due:
            del self._lines[line.topic]
            line.see(TopicEvent.WAITED)
        return due

    def forget(self, line: TopicQueue) -> None:
        """Remove an empty topic queue."""
        self._lines.pop(line.topic, None)

    def clear(self) -> None:
        """Forget all: after a reconnect each topic is probed again."""
        self._lines.clear()
