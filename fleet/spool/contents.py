"""The messages of a spool and where each stands: in memory, on disk as well, or on disk alone."""

from __future__ import annotations

from collections.abc import Container

from fleet.spool.losses import Losses, Reason
from fleet.spool.memory_buffer import MemoryBuffer
from fleet.spool.message import Outgoing
from fleet.spool.pending_deletions import PendingDeletions
from fleet.spool.topic_queue import TopicQueue
from fleet.spool.topic_queues import TopicQueues
from fleet.spool.unwritten import UnwrittenMessages


class SpoolContents:
    """All messages of a spool that wait; ``messages`` and ``size`` (bytes) bound what stands in memory.

    ``waiting`` counts them, ``on_disk`` those of them that stand on disk alone, or are on their way there.
    ``unwritten`` are to be written to disk, ``deletions`` are rows there that nobody waits for any more.
    ``keeps_on_disk``: there is a disk to write to, though it may fail.
    """

    def __init__(self, messages: int, size: int, *, keeps_on_disk: bool) -> None:
        self.waiting = 0
        self.on_disk = 0
        self.losses = Losses()
        self.keeps_on_disk = keeps_on_disk
        self.memory = MemoryBuffer(messages, size)
        self.queues = TopicQueues(self.memory)
        self.unwritten = UnwrittenMessages()
        self.deletions = PendingDeletions()

    def add(self, queue: TopicQueue, message: Outgoing) -> None:
        """Add a new message behind all of its topic; ``on_disk`` says that it will stand there alone."""
        self.waiting += 1
        self.memory.add(message)
        if message.on_disk:
            queue.cold_from = queue.cold_from if queue.on_disk else message.seq
            queue.on_disk += 1
            self.on_disk += 1
        else:
            queue.memory.append(message)
            queue.loaded = message.seq
        if self.keeps_on_disk:
            self.unwritten.add(message)
        self.queues.stand(queue)

    def take(self, queue: TopicQueue, message: Outgoing) -> None:
        """Remove a message of a queue that is sent now; it stays on disk until it is settled."""
        self.memory.remove(message)
        self.waiting -= 1
        queue.flying += 1

    def take_back(self, queue: TopicQueue, message: Outgoing) -> None:
        """Put a message back that was sent, before all that are newer."""
        if message.gone:
            return
        queue.give_back(message)
        self.memory.add_again(message)
        self.waiting += 1

    def forget(self, message: Outgoing) -> None:
        """Note that nobody waits for a message any more; its row on disk is deleted, or never written."""
        message.gone = True
        if message.stored:
            self.deletions.add(message.seq)
        elif self.keeps_on_disk:
            self.unwritten.tombstone()

    def lose(self, message: Outgoing, reason: Reason, wall: float) -> TopicQueue:
        """Drop a message that stood in memory; return its queue, which may be empty now."""
        queue = self.queues[message.topic]
        self.memory.remove(message)
        self.forget(message)
        self.waiting -= 1
        if message.on_disk:
            queue.on_disk -= 1
            self.on_disk -= 1
        queue.shed()
        self.losses.note(message.topic, message.traffic, reason, wall)
        return queue

    # -- on disk alone -------------------------------------------------------------------------------

    def is_on_disk_alone(self, queue: TopicQueue, seq: int) -> bool:
        """Return whether a row that was met on disk is a message that waits and stands nowhere else."""
        return seq > queue.loaded and seq not in self.deletions and seq not in queue.ahead

    def load(self, queue: TopicQueue, message: Outgoing) -> None:
        """Have a message stand in memory that stood on disk alone."""
        message.on_disk = False
        queue.memory.append(message)
        queue.loaded = queue.cold_from = message.seq
        queue.on_disk -= 1
        self.on_disk -= 1

    def load_unwritten(self, topics: Container[str]) -> None:
        """Have those messages of some topics stand in memory that never reached the disk."""
        for message in self.unwritten:
            if message.on_disk and not message.gone and message.topic in topics:
                self.load(self.queues[message.topic], message)

    def lose_on_disk(self, queue: TopicQueue, lost: int, reason: Reason, wall: float) -> None:
        """Count out messages that stood on disk alone, and are there no more."""
        queue.on_disk -= lost
        self.on_disk -= lost
        self.waiting -= lost
        self.losses.note(queue.topic, queue.traffic, reason, wall, lost)
        self.queues.stand(queue)
