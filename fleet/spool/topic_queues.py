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
        self.holds = HeldTopics()

    def of(self, topic: str, traffic: TrafficClass) -> TopicQueue:
        """Return the queue of a topic; create it if there is none."""
        line = self.get(topic)
        if line is None:
            line = self[topic] = TopicQueue(topic, traffic)
        return line

    def stand(self, line: TopicQueue) -> None:
        """Put a queue into the ring if it can send, and into ``needs_fetch`` if it runs low."""
        if not line.queued and line.sendable:
            line.queued = True
            self.rings[line.traffic].append(line)
        if line.on_disk and self.online and len(line.memory) + len(line.back) < self._low(line):
            self.needs_fetch[line.topic] = line
        elif self.needs_fetch:
            self.needs_fetch.pop(line.topic, None)

    def forget(self, line: TopicQueue) -> None:
        """Forget an empty queue that is not open, or is an inbox for replies, which is used once."""
        if (line.state is OPEN and line.traffic is not REPLY) or not line.empty:
            return  # the common case
        self.pop(line.topic, None)
        self.needs_fetch.pop(line.topic, None)
        self.holds.forget(line)
        if line.queued:
            self.rings[line.traffic].remove(line)
            line.queued = False

    def _low(self, line: TopicQueue) -> int:
        """Return the number of messages of a queue that should be in memory at least."""
        if line.state is TopicState.HELD:
            return 1
        return LOW_IN_NEED if self._memory.full else LOW
