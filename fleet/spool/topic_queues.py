"""The topic queues of a spool, and which of them can send, need messages from disk, or are held."""

from __future__ import annotations

from collections import deque

from fleet.spool.held_topics import HeldTopics
from fleet.spool.memory_buffer import DURABLE, MemoryBuffer
from fleet.spool.topic_queue import OPEN, REPLY, TopicQueue, TopicState
from fleet.wire.rules import TrafficClass

LOW = 64
"""Messages of a topic in memory below which more are fetched from disk."""
LOW_IN_NEED = 8
"""The same while memory is full."""


class TopicQueues(dict[str, TopicQueue]):
    """Topic queues by topic; their messages in memory are in ``memory``.

    ``rings`` has those that can send, by class, in round-robin order; ``needs_fetch`` those that need
    messages from disk while ``online``.
    """

    def __init__(self, memory: MemoryBuffer) -> None:
        super().__init__()
        self.online = False
        self._memory = memory
        self.rings: list[deque[TopicQueue]] = [deque() for _ in DURABLE]
        self.needs_fetch: dict[str, TopicQueue] = {}
        self.held_topics = HeldTopics()

    def of(self, topic: str, traffic: TrafficClass) -> TopicQueue:
        """Return the queue of a topic; create it if there is none."""
        queue = self.get(topic)
        if queue is None:
            queue = self[topic] = TopicQueue(topic, traffic)
        return queue

    def reschedule(self, queue: TopicQueue) -> None:
        """Put a queue into the ring if it can send, and into ``needs_fetch`` if it runs low."""
        if not queue.queued and queue.sendable:
            queue.queued = True
            self.rings[queue.traffic].append(queue)
        if queue.on_disk and self.online and len(queue.memory) + len(queue.back) < self._low(queue):
            self.needs_fetch[queue.topic] = queue
        elif self.needs_fetch:
            self.needs_fetch.pop(queue.topic, None)

    def forget(self, queue: TopicQueue) -> None:
        """Forget an empty queue that is not open, or is an inbox for replies, which is used once."""
        if (queue.state is OPEN and queue.traffic is not REPLY) or not queue.empty:
            return  # the common case
        self.pop(queue.topic, None)
        self.needs_fetch.pop(queue.topic, None)
        self.held_topics.forget(queue)
        if queue.queued:
            self.rings[queue.traffic].remove(queue)
            queue.queued = False

    def _low(self, queue: TopicQueue) -> int:
        """Return the number of messages of a queue that should be in memory at least."""
        if queue.state is TopicState.HELD:
            return 1
        return LOW_IN_NEED if self._memory.full else LOW
