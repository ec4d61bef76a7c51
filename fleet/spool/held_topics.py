"""Topics without a subscriber, and when each is retried."""

from __future__ import annotations

from fleet.spool.topic_queue import OPEN, TopicEvent, TopicQueue

FIRST_WAIT = 1.0
"""Seconds until a topic without a subscriber is retried, doubled each time."""
LONGEST_WAIT = 15.0


class HeldTopics:
    """Topic queues in the state HELD; times are monotonic seconds."""

    def __init__(self) -> None:
        self._queues: dict[str, TopicQueue] = {}

    def __len__(self) -> int:
        return len(self._queues)

    @property
    def messages(self) -> int:
        """The number of waiting messages in all of them."""
        return sum(queue.waiting for queue in self._queues.values())

    def unsubscribed(self, queue: TopicQueue, now: float) -> None:
        """Hold a topic queue; the delay grows with each attempt, not with each message in flight."""
        if queue.transition(TopicEvent.UNHEARD):
            queue.retry = now + min(LONGEST_WAIT, FIRST_WAIT * 2**queue.unsubscribed)
            queue.unsubscribed = min(queue.unsubscribed + 1, 8)
            self._queues[queue.topic] = queue

    def record_subscriber(self, queue: TopicQueue, now: float) -> None:
        """Record that a topic has a subscriber; if it had none before, retry all held topics immediately."""
        if queue.state is OPEN:  # the common case
            return
        queue.transition(TopicEvent.HEARD)
        if queue.unsubscribed:
            queue.unsubscribed = 0
            for other in self._queues.values():
                other.retry = now

    def due(self, now: float) -> list[TopicQueue]:
        """Remove and return the topic queues to retry."""
        due = [queue for queue in self._queues.values() if queue.retry <= now]
        for queue in due:
            del self._queues[queue.topic]
            queue.transition(TopicEvent.WAITED)
        return due

    def forget(self, queue: TopicQueue) -> None:
        """Remove an empty topic queue."""
        self._queues.pop(queue.topic, None)

    def clear(self) -> None:
        """Forget all: after a reconnect each topic is probed again."""
        self._queues.clear()
