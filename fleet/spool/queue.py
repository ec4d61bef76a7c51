"""Decisions of the spool without I/O and clock: what to send next, to write to disk, to drop.

A message is in memory and, if it is not acknowledged soon, also on disk. Beyond the bound on memory it is on
disk only, and fetched when it is to be sent soon. The order within each topic is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet.spool.contents import SpoolContents
from fleet.spool.disk_exchange import DiskExchange
from fleet.spool.losses import Reason
from fleet.spool.memory_buffer import DURABLE
from fleet.spool.message import DeliveryOutcome, Outgoing
from fleet.spool.statistics import SECOND, ClassStatistics, class_statistics
from fleet.spool.topic_queue import REPLY, TopicEvent, TopicQueue
from fleet.wire.rules import TrafficClass

NEWEST_FIRST = 0.1
"""Seconds after a connect in which the newest state goes before the queued messages."""
BURST = 16
"""Messages of one topic that are sent before other topics are served."""
_HELD, _REFUSED = DeliveryOutcome.HELD, DeliveryOutcome.REFUSED


class SpoolQueue:
    """All durable messages of one edge. Times are monotonic seconds, ``wall`` is Unix time.

    ``messages`` and ``size`` (bytes) bound the messages in memory. Sequence numbers start after ``first``.
    ``disk`` is the interface of the disk thread.
    """

    def __init__(
        self, messages: int, size: int, ages: Mapping[TrafficClass, float], *, disk: bool, first: int = 0
    ) -> None:
        self._contents = SpoolContents(messages, size, keeps_on_disk=disk)
        self.disk = DiskExchange(self._contents, first)
        self.losses = self._contents.losses
        self._memory = self._contents.memory
        self._queues = self._contents.queues
        self._ages = [ages[kind] for kind in DURABLE]  # a list: hashing an enum for a dict is slow
        self._seq = first
        self._durable_from = float("-inf")  # from when on messages other than replies are sent

    @property
    def waiting(self) -> int:
        """The number of waiting messages."""
        return self._contents.waiting

    @property
    def on_disk(self) -> int:
        """The number of those that are on disk only, or are being written there."""
        return self._contents.on_disk

    def put(self, message: Outgoing, now: float, wall: float) -> bool:
        """Queue a message; return False if it does not fit, even after less important ones are dropped."""
        age = self._ages[message.traffic]
        if message.expiry is not None:
            age = min(age, message.expiry)
        message.since, message.deadline, message.expires = now, now + age, wall + age
        self._seq = message.seq = max(self._seq + 1, self.disk.before + 1, int(wall * SECOND))
        queue = self._queues.of(message.topic, message.traffic)
        fits, failing = self._memory.fits(message), self.disk.failing
        message.on_disk = bool(queue.on_disk) or (self._contents.keeps_on_disk and not failing and not fits)
        share = 1 if failing or not message.on_disk else 2
        if not (fits or self._make_room(queue, message, share, wall)):
            self._queues.forget(queue)
            self.losses.note(message.topic, message.traffic, Reason.ROOM, wall)
            return False
        self._contents.add(queue, message)
        return True

    def _make_room(self, queue: TopicQueue, message: Outgoing, share: int, wall: float) -> bool:
        """Drop older messages that are not more important; return whether the message fits then."""
        if not self._memory.can_fit(message, share):
            return False
        for oldest in self._memory.droppable(message, share):
            other = self._contents.lose(oldest, Reason.ROOM, wall)
            if other is not queue:
                self._queues.forget(other)
        return True

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return the next messages to send: at most ``window``, about ``size`` bytes.

        The last ``reserve`` places of the window are for replies.
        """
        batch: list[Outgoing] = []
        if not self.online or not any(self._queues.rings):
            return batch
        for kind, ring in zip(DURABLE, self._queues.rings, strict=True):
            most = window if kind is REPLY else window - reserve
            if kind is not REPLY and now < self._durable_from:
                break
            while ring and len(batch) < most and size > 0:
                queue = ring.popleft()
                queue.queued = False
                size -= self._take(queue, batch, min(most, len(batch) + BURST), size, now)
                if not queue.quiet:
                    self._queues.reschedule(queue)
                    self._queues.forget(queue)
        return batch

    def _take(self, queue: TopicQueue, batch: list[Outgoing], most: int, size: int, now: float) -> int:
        """Move messages of a topic into the batch; return their bytes."""
        taken = 0
        while queue.sendable and len(batch) < most and taken < size:
            message = queue.pop()
            if message.gone:
                continue
            if message.deadline is not None and message.deadline <= now:
                self._contents.lose(message, Reason.AGE, message.expires)
                continue
            self._contents.take(queue, message)
            taken += message.size
            batch.append(message)
        return taken

    def settle(self, message: Outgoing, outcome: DeliveryOutcome, now: float, wall: float) -> None:
        """Apply the broker's acknowledgement of an in-flight message."""
        queue = self._queues[message.topic]
        queue.in_flight -= 1
        if outcome is _HELD:
            self._contents.requeue(queue, message)
            self._queues.held_topics.unsubscribed(queue, now)
            return
        if outcome is _REFUSED:
            self.losses.note(message.topic, message.traffic, Reason.REFUSED, wall)
        self._contents.forget(message)
        if not queue.quiet:
            self._queues.held_topics.record_subscriber(queue, now)
            self._queues.reschedule(queue)
            self._queues.forget(queue)

    def requeue(self, messages: Iterable[Outgoing]) -> None:
        """Take back the messages, oldest first, that were in flight when the connection ended."""
        oldest_first = list(messages)
        for message in reversed(oldest_first):
            queue = self._queues[message.topic]
            queue.in_flight -= 1
            self._contents.requeue(queue, message)
        for message in oldest_first:
            self._queues.reschedule(self._queues[message.topic])

    def go_online(self, now: float) -> None:
        """Start a new connection; every topic is probed for subscribers again."""
        self._queues.online = True
        self._durable_from = now + NEWEST_FIRST if self.waiting else now
        self._queues.held_topics.clear()
        for queue in self._queues.values():
            queue.transition(TopicEvent.CONNECTED)
            self._queues.reschedule(queue)

    def go_offline(self) -> None:
        """Record the end of the connection."""
        self._queues.online = False
        self._queues.needs_fetch.clear()

    def tick(self, now: float, wall: float) -> None:
        """Drop expired messages, and retry held topics that are due."""
        for message in self._memory.late(now):
            self._queues.forget(self._contents.lose(message, Reason.AGE, wall))
        for queue in self._queues.held_topics.due(now):
            self._queues.reschedule(queue)

    def close(self) -> None:
        """Drop the messages in memory."""
        for message in self._memory.all():
            self._memory.remove(message)
        self._contents.waiting = 0

    @property
    def online(self) -> bool:
        """True while there is a connection."""
        return self._queues.online

    @property
    def idle(self) -> bool:
        """True when there is nothing to send now."""
        return not (any(self._queues.rings) or self._queues.needs_fetch)

    @property
    def held(self) -> int:
        """The number of topics that wait for a subscriber."""
        return len(self._queues.held_topics)

    @property
    def unsubscribed(self) -> int:
        """The number of messages that wait for a subscriber of their topic."""
        return self._queues.held_topics.messages

    def statistics(self) -> dict[TrafficClass, ClassStatistics]:
        """Return the statistics of each class."""
        return class_statistics(self._queues.values())
