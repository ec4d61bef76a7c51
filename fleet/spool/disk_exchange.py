"""What the thread of the disk is asked to do for a spool, and what it reports: without I/O and clock."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.spool.contents import SpoolContents
from fleet.spool.disk_work import DiskWork, FetchRequest
from fleet.spool.losses import Reason
from fleet.spool.message import Outgoing
from fleet.spool.topic_queues import LOW_IN_NEED
from fleet.wire.rules import TrafficClass

FETCHED = 256
"""Messages of a topic that one fetch brings at most, LOW_IN_NEED when memory is full."""


class DiskExchange:
    """The disk's side of a spool's contents.

    ``failing``: no disk takes what is to be written. ``before``: the newest number of an earlier process,
    and of all messages before it.
    """

    def __init__(self, contents: SpoolContents, first: int) -> None:
        self.failing = False
        self.before = first
        self._contents = contents
        self._queues = contents.queues
        self._writing = False

    @property
    def needs_fetch(self) -> bool:
        """True when messages are wanted from disk."""
        return bool(self._queues.needs_fetch)

    @property
    def unwritten(self) -> bool:
        """True when something is being changed on disk, or is to be soon.

        Any thread may look: each is looked at once, and what is being written last, for it is marked first.
        """
        contents = self._contents
        changed = len(contents.unwritten) > 0 or len(contents.deletions) > 0 or contents.losses.changed
        return changed or self._writing

    def work(self, now: float) -> DiskWork:
        """Remove and return what is to be changed on disk now."""
        contents = self._contents
        self._writing = True
        rows = contents.unwritten.take(now, at_once=not self._queues.online or contents.on_disk > 0)
        done = contents.deletions.take()
        self._writing = bool(rows or done)
        return DiskWork(rows, done)

    def wrote(self, work: DiskWork) -> None:
        """Note that a change is on disk: what stands there alone has left memory."""
        self.failing = self._writing = False
        self._contents.deletions.deleted()
        for message in work.rows:
            if message.on_disk and not message.gone:
                message.gone = True
                self._contents.memory.remove(message)

    def not_written(self, work: DiskWork) -> None:
        """Take a change back that the disk did not take."""
        self._contents.deletions.put_back()
        self._contents.unwritten.put_back(work.rows)
        self.failing, self._writing = True, False

    def fetches(self) -> list[FetchRequest]:
        """Return of which topics more is wanted."""
        share = self._contents.memory.room // max(1, len(self._queues.needs_fetch))
        limit = max(LOW_IN_NEED, min(FETCHED, share))
        return [
            FetchRequest(queue.topic, queue.traffic, queue.loaded, limit)
            for queue in self._queues.needs_fetch.values()
        ]

    def fetched(self, topic: str, messages: Sequence[Outgoing], *, more: bool) -> None:
        """Take messages from disk; ``more``: there are further ones. The last ones never reached the disk."""
        queue = self._queues.needs_fetch.pop(topic, None)
        if queue is None:
            return
        for message in messages:
            if self._contents.is_on_disk_alone(queue, message.seq):
                self._contents.load(queue, message)
                self._contents.memory.add(message)
        if messages:  # also when none was wanted: the next fetch goes on behind them
            queue.loaded = max(queue.loaded, messages[-1].seq)
        if not more:
            self._contents.load_unwritten((topic,))
        self._queues.stand(queue)
        self._queues.forget(queue)

    def found(self, topic: str, traffic: TrafficClass, count: int, oldest: int, newest: int) -> None:
        """Note what an earlier process left on disk; what came before the disk could be read follows it."""
        contents = self._contents
        self.before = max(self.before, newest)
        queue = self._queues.of(topic, traffic)
        live = [message for message in queue.memory if not message.gone]
        for message in live:
            message.on_disk = True
        queue.memory.clear()
        queue.loaded, queue.cold_from = 0, oldest
        if queue.flying or queue.back:
            mine = (one for one in contents.unwritten if one.topic == topic and not (one.gone or one.on_disk))
            queue.ahead = frozenset(one.seq for one in mine)
        queue.on_disk += len(live) + count
        contents.on_disk += len(live) + count
        contents.waiting += count
        self._queues.stand(queue)

    def removed(self, topic: str, seqs: Sequence[int], reason: Reason, wall: float) -> None:
        """Note that messages were removed from disk: those that are not under way are lost."""
        queue = self._queues.get(topic)
        if queue is None:
            return
        if lost := sum(self._contents.is_on_disk_alone(queue, seq) for seq in seqs):
            self._contents.lose_on_disk(queue, lost, reason, wall)
            queue.cold_from = max(queue.cold_from, *seqs)
        removed = set(seqs)
        for message in (*queue.back, *queue.memory):
            if message.seq in removed and not message.gone:
                self._contents.lose(message, reason, wall)
        self._queues.forget(queue)

    def lost_disk(self, wall: float) -> None:
        """Note that what was on disk is lost; what is in memory is written anew."""
        contents = self._contents
        for queue in list(self._queues.values()):
            mine = (one for one in contents.unwritten if one.topic == queue.topic)
            kept = sum(one.on_disk and not one.gone for one in mine)
            if queue.on_disk > kept:
                contents.lose_on_disk(queue, queue.on_disk - kept, Reason.CORRUPT, wall)
            for message in (*queue.back, *queue.memory):
                if message.stored and not message.gone:
                    message.stored = False
                    contents.unwritten.add(message)
            self._queues.forget(queue)
        contents.deletions.clear()

    def no_disk(self) -> None:
        """Note that there is no file at all: memory alone serves, also for what was to leave it."""
        self.failing = True
        if self._contents.on_disk:
            self._contents.load_unwritten(self._queues)
            for queue in self._queues.values():
                self._queues.stand(queue)
