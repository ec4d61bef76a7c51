"""What is sent next, what goes to disk, what is dropped: the spool's decisions, without I/O and clock.

A message stands in memory and, when nobody has taken it for a moment, on disk too. Beyond the bound on
memory it stands on disk alone and comes back when its turn is near. Order is kept in each topic.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fleet.spool.contents import SpoolContents
from fleet.spool.disk_exchange import DiskExchange
from fleet.spool.losses import Reason
from fleet.spool.memory_buffer import DURABLE
from fleet.spool.message import Outcome, Outgoing
from fleet.spool.statistics import SECOND, ClassStatistics, class_statistics
from fleet.spool.topic_queue import REPLY, TopicEvent, TopicQueue
from fleet.wire.rules import TrafficClass

NEWEST_FIRST = 0.1
"""Seconds after a connect in which what has waited lets the newest state go first."""
BURST = 16
"""Messages of one topic that go before another topic has its turn."""
_HELD, _REFUSED = Outcome.HELD, Outcome.REFUSED


class SpoolQueue:
    """All durable messages of one edge. Times are monotonic seconds, ``wall`` is Unix time.

    ``messages`` and ``size`` (bytes) bound what stands in memory. ``first``: what the numbers begin after.
    ``disk`` is the side of it that the disk's thread works on.
    """

    def __init__(
        self, messages: int, size: int, ages: Mapping[TrafficClass, float], *, disk: bool, first: int = 0
    ) -> None:
        self._contents = SpoolContents(messages, size, keeps_on_disk=disk)
        self.disk = DiskExchange(self._contents, first)
        self.losses = self._contents.losses
        self._memory = self._contents.memory
        self._queues = self._contents.queues
        self._ages = [ages[kind] for kind in DURABLE]  # lists: a dictionary hashes an enumeration slowly
        self._seq = first
        self._durable_from = float("-inf")  # when others than replies are sent

    @property
    def waiting(self) -> int:
        """How many messages wait."""
        return self._contents.waiting

    @property
    def on_disk(self) -> int:
        """How many of them stand on disk alone, or are on their way there."""
        return self._contents.on_disk

    def put(self, message: Outgoing, now: float, wall: float) -> bool:
        """Take a message; return False when it is larger, or matters less, than all there is room for."""
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
        """Push out what is older and matters no more than a message of a queue; tell whether it fits then."""
        if not self._memory.can_fit(message, share):
            return False
        for oldest in self._memory.in_the_way(message, share):
            other = self._contents.lose(oldest, Reason.ROOM, wall)
            if other is not queue:
                self._queues.forget(other)
        return True

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return what may be written next, at most ``window`` messages and about ``size`` bytes.

        The last ``reserve`` of the window are for replies.
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
                    self._queues.stand(queue)
                    self._queues.forget(queue)
        return batch

    def _take(self, queue: TopicQueue, batch: list[Outgoing], most: int, size: int, now: float) -> int:
        """Move messages of a queue into the batch; return their bytes."""
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

    def settle(self, message: Outgoing, outcome: Outcome, now: float, wall: float) -> None:
        """Take what the broker said of a message that was taken."""
        queue = self._queues[message.topic]
        queue.flying -= 1
        if outcome is _HELD:
            self._contents.take_back(queue, message)
            self._queues.holds.unheard(queue, now)
            return
        if outcome is _REFUSED:
            self.losses.note(message.topic, message.traffic, Reason.REFUSED, wall)
        self._contents.forget(message)
        if not queue.quiet:
            self._queues.holds.heard(queue, now)
            self._queues.stand(queue)
            self._queues.forget(queue)

    def put_back(self, messages: Iterable[Outgoing]) -> None:
        """Take back messages, oldest first, that were under way when the connection ended."""
        oldest_first = list(messages)
        for message in reversed(oldest_first):
            queue = self._queues[message.topic]
            queue.flying -= 1
            self._contents.take_back(queue, message)
        for message in oldest_first:
            self._queues.stand(self._queues[message.topic])

    def go_online(self, now: float) -> None:
        """Begin a new connection: nobody knows yet who hears."""
        self._queues.online = True
        self._durable_from = now + NEWEST_FIRST if self.waiting else now
        self._queues.holds.clear()
        for queue in self._queues.values():
            queue.see(TopicEvent.CONNECTED)
            self._queues.stand(queue)

    def go_offline(self) -> None:
        """Note the end of the connection."""
        self._queues.online = False
        self._queues.needs_fetch.clear()

    def tick(self, now: float, wall: float) -> None:
        """Look after time: what is too old is dropped, what was held is tried again."""
        for message in self._memory.late(now):
            self._queues.forget(self._contents.lose(message, Reason.AGE, wall))
        for queue in self._queues.holds.due(now):
            self._queues.stand(queue)

    def close(self) -> None:
        """Drop what stands in memory."""
        for message in self._memory.all():
            self._memory.remove(message)
        self._contents.waiting = 0

    @property
    def online(self) -> bool:
        """True while there is a connection."""
        return self._queues.online

    @property
    def idle(self) -> bool:
        """True when nothing could be sent now."""
        return not (any(self._queues.rings) or self._queues.needs_fetch)

    @property
    def held(self) -> int:
        """How many topics wait for somebody to hear them."""
        return len(self._queues.holds)

    @property
    def unheard(self) -> int:
        """How many messages wait for somebody to hear their topics."""
        return self._queues.holds.messages

    def standing(self) -> dict[TrafficClass, ClassStatistics]:
        """Return what waits of each class."""
        return class_statistics(self._queues.values())
