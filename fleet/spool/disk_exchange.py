"""The interface between a spool and its disk thread, without I/O and clock."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.spool.contents import SpoolContents
from fleet.spool.disk_work import DiskWork, FetchRequest
from fleet.spool.losses import Reason
from fleet.spool.message import Outgoing
from fleet.spool.topic_queues import LOW_IN_NEED
from fleet.wire.rules import TrafficClass

FETCHED = 256
"""Most messages of a topic in one fetch; LOW_IN_NEED while memory is full."""


class DiskExchange:
    """The disk thread's view of the contents of a spool.

    ``failing``: writes fail at the moment. ``before``: the newest sequence number of an earlier process; this
    process uses higher ones only.
    """

    def __init__(self, contents: SpoolContents, first: int) -> None:
        self.failing = False
        self.before = first
        self._contents = contents
        self._queues = contents.queues
        self._writing = False

    @property
    def needs_fetch(self) -> bool:
        """True when messages are to be fetched from disk."""
        return bool(self._queues.needs_fetch)

    @property
    def unwritten(self) -> bool:
        """True while changes are being written to disk, or are to be written soon.

        Any thread may read it without a lock. ``_writing`` is read last because ``work`` sets it first, so a
        change is never missed between the two.
        """
        contents = self._contents
        changed = len(contents.unwritten) > 0 or len(contents.deletions) > 0 or contents.losses.changed
        return changed or self._writing

    def work(self, now: float) -> DiskWork:
        """Remove and return the changes to write now."""
        contents = self._contents
        self._writing = True
        rows = contents.unwritten.take(now, at_once=not self._queues.online or contents.on_disk > 0)
        done = contents.deletions.take()
        self._writing = bool(rows or done)
        return DiskWork(rows, done)

    def wrote(self, work: DiskWork) -> None:
        """Record that changes are on disk: messages that are on disk only leave memory."""
        self.failing = self._writing = False
        self._contents.deletions.deleted()
        for message in work.rows:
            if message.on_disk and not message.gone:
                message.gone = True
                self._contents.memory.remove(message)

    def not_written(self, work: DiskWork) -> None:
        """Take back changes that could not be written."""
        self._contents.deletions.requeue()
        self._contents.unwritten.requeue(work.rows)
        self.failing, self._writing = True, False

    def fetches(self) -> list[FetchRequest]:
        """Return the requests to fetch messages."""
        share = self._contents.memory.room // max(1, len(self._queues.needs_fetch))
        limit = max(LOW_IN_NEED, min(FETCHED, share))
        return [
            FetchRequest(queue.topic, queue.traffic, queue.loaded, limit)
            for queue in self._queues.needs_fetch.values()
        ]

    def fetched(self, topic: str, messages: Sequence[Outgoing], *, more: bool) -> None:
        """Add messages fetched from disk; ``more``: there are further ones on disk.

        After the last fetch, messages that never reached the disk follow.
        """
        queue = self._queues.needs_fetch.pop(topic, None)
        if queue is None:
            return
        for message in messages:
            if self._contents.is_on_disk_only(queue, message.seq):
                self._contents.load(queue, message)
                self._contents.memory.add(message)
        if messages:  # even if none was needed: the next fetch continues after them
            queue.loaded = max(queue.loaded, messages[-1].seq)
        if not more:
            self._contents.load_unwritten((topic,))
        self._queues.reschedule(queue)
        self._queues.forget(queue)

    def found(self, topic: str, traffic: TrafficClass, count: int, oldest: int, newest: int) -> None:
        """Add the messages of an earlier process; those queued before the disk could be read follow them."""
        contents = self._contents
        self.before = max(self.before, newest)
        queue = self._queues.of(topic, traffic)
        live = [message for message in queue.memory if not message.gone]
        for message in live:
            message.on_disk = True
        queue.memory.clear()
        queue.loaded, queue.oldest_on_disk = 0, oldest
        if queue.in_flight or queue.back:
            mine = (one for one in contents.unwritten if one.topic == topic and not (one.gone or one.on_disk))
            queue.ahead = frozenset(one.seq for one in mine)
        queue.on_disk += len(live) + count
        contents.on_disk += len(live) + count
        contents.waiting += count
        self._queues.reschedule(queue)

    def removed(self, topic: str, seqs: Sequence[int], reason: Reason, wall: float) -> None:
        """Handle the removal of rows from disk: their messages are lost, except those in flight."""
        queue = self._queues.get(topic)
        if queue is None:
            return
        if lost := sum(self._contents.is_on_disk_only(queue, seq) for seq in seqs):
            self._contents.lose_on_disk(queue, lost, reason, wall)
            queue.oldest_on_disk = max(queue.oldest_on_disk, *seqs)
        removed = set(seqs)
        for message in (*queue.back, *queue.memory):
            if message.seq in removed and not message.gone:
                self._contents.lose(message, reason, wall)
        self._queues.forget(queue)

    def lost_disk(self, wall: float) -> None:
        """Handle the loss of the file: rewrite the messages still in memory, count the others as lost."""
        contents = self._contents
        for queue in list(self._queues.values()):
            kept = sum(
                one.topic == queue.topic and one.on_disk and not one.gone for one in contents.unwritten
            )
            if queue.on_disk > kept:
                contents.lose_on_disk(queue, queue.on_disk - kept, Reason.CORRUPT, wall)
            for message in (*queue.back, *queue.memory):
                if message.stored and not message.gone:
                    message.stored = False
                    contents.unwritten.add(message)
            self._queues.forget(queue)
        contents.deletions.clear()

    def disk_missing(self) -> None:
        """Handle a missing file: keep all messages in memory, even those that were to leave it."""
        self.failing = True
        if self._contents.on_disk:
            self._contents.load_unwritten(self._queues)
            for queue in self._queues.values():
                self._queues.reschedule(queue)
