"""The messages of a spool and where each is stored: in memory, also on disk, or on disk only."""

from __future__ import annotations

from collections.abc import Container

from fleet.spool.losses import MessageLosses, Reason
from fleet.spool.memory_buffer import MemoryBuffer
from fleet.spool.message import Outgoing
from fleet.spool.pending_deletions import PendingDeletions
from fleet.spool.topic_queue import TopicQueue
from fleet.spool.topic_queues import TopicQueues
from fleet.spool.unwritten import UnwrittenMessages


class SpoolContents:
    """All waiting messages of a spool; ``messages`` and ``size`` (bytes) bound those in memory.

    ``waiting`` counts them, ``on_disk`` those that are on disk only, or are being written there.
    ``unwritten`` are to be written to disk, ``deletions`` are rows to delete. ``keeps_on_disk``: the spool
    has a disk, which may fail.
    """

    def __init__(self, messages: int, size: int, *, keeps_on_disk: bool) -> None:
        self.waiting = 0
        self.on_disk = 0
        self.losses = MessageLosses()
        self.keeps_on_disk = keeps_on_disk
        self.memory = MemoryBuffer(messages, size)
        self.queues = TopicQueues(self.memory)
        self.unwritten = UnwrittenMessages()
        self.deletions = PendingDeletions()

    def add(self, queue: TopicQueue, message: Outgoing) -> None:
        """Add a new message to the end of its topic; ``on_disk`` says that it will be on disk only."""
        self.waiting += 1
        self.memory.add(message)
        if message.on_disk:
            queue.oldest_on_disk = queue.oldest_on_disk if queue.on_disk else message.seq
            queue.on_disk += 1
            self.on_disk += 1
        else:
            queue.memory.append(message)
            queue.loaded = message.seq
        if self.keeps_on_disk:
            self.unwritten.add(message)
        self.queues.reschedule(queue)

    def take(self, queue: TopicQueue, message: Outgoing) -> None:
        """Remove a message that is sent now; its row on disk stays until it is settled."""
        self.memory.remove(message)
        self.waiting -= 1
        queue.in_flight += 1

    def requeue(self, queue: TopicQueue, message: Outgoing) -> None:
        """Return a message that was in flight to the head of its topic."""
        if message.gone:
            return
        queue.requeue(message)
        self.memory.add_again(message)
        self.waiting += 1

    def forget(self, message: Outgoing) -> None:
        """Mark a message as gone: its row on disk is deleted, or never written."""
        message.gone = True
        if message.stored:
            self.deletions.add(message.seq)
        elif self.keeps_on_disk:
            self.unwritten.tombstone()

    def lose(self, message: Outgoing, reason: Reason, wall: float) -> TopicQueue:
        """Drop a message that was in memory; return its queue, which may be empty now."""
        queue = self.queues[message.topic]
        self.memory.remove(message)
        self.forget(message)
        self.waiting -= 1
        if message.on_disk:
            queue.on_disk -= 1
            self.on_disk -= 1
        queue.drop_gone()
        self.losses.note(message.topic, message.traffic, reason, wall)
        return queue

    # -- on disk only --------------------------------------------------------------------------------

    def is_on_disk_only(self, queue: TopicQueue, seq: int) -> bool:
        """Return whether a row found on disk is a waiting message that is on disk only."""
        return seq > queue.loaded and seq not in self.deletions and seq not in queue.ahead

    def load(self, queue: TopicQueue, message: Outgoing) -> None:
        """Move a message that was on disk only into memory."""
        message.on_disk = False
        queue.memory.append(message)
        queue.loaded = queue.oldest_on_disk = message.seq
        queue.on_disk -= 1
        self.on_disk -= 1

    def load_unwritten(self, topics: Container[str]) -> None:
        """Move the messages of some topics into memory that never reached the disk."""
        for message in self.unwritten:
            if message.on_disk and not message.gone and message.topic in topics:
                self.load(self.queues[message.topic], message)

    def lose_on_disk(self, queue: TopicQueue, lost: int, reason: Reason, wall: float) -> None:
        """Subtract lost messages that were on disk only."""
        queue.on_disk -= lost
        self.on_disk -= lost
        self.waiting -= lost
        self.losses.note(queue.topic, queue.traffic, reason, wall, lost)
        self.queues.reschedule(queue)
