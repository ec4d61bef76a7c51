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
from fleet.spool.message import Outcome, Outgoing
from fleet.spool.statistics import SECOND, ClassStatistics, class_statistics
from fleet.spool.topic_queue import REPLY, TopicEvent, TopicQueue
from fleet.wire.rules import TrafficClass

NEWEST_FIRST = 0.1
"""Seconds after a connect in which the newest state goes before the queued messages."""
BURST = 16
"""Messages of one topic that are sent before other topics are served."""
_HELD, _REFUSED = Outcome.HELD, Outcome.REFUSED


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
        self._lines = self._contents.lines
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
        line = self._lines.of(message.topic, message.traffic)
        fits, failing = self._memory.fits(message), self.disk.failing
        message.on_disk = bool(line.on_disk) or (self._contents.keeps_on_disk and not failing and not fits)
        share = 1 if failing or not message.on_disk else 2
        if not (fits or self._make_room(line, message, share, wall)):
            self._lines.forget(line)
            self.losses.note(message.topic, message.traffic, Reason.ROOM, wall)
            return False
        self._contents.add(line, message)
        return True

    def _make_room(self, line: TopicQueue, message: Outgoing, share: int, wall: float) -> bool:
        """Drop older messages that are not more important; return whether the message fits then."""
        if not self._memory.can_fit(message, share):
            return False
        for oldest in self._memory.in_the_way(message, share):
            other = self._contents.lose(oldest, Reason.ROOM, wall)
            if other is not line:
                self._lines.forget(other)
        return True

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return the next messages to send: at most ``window``, about ``size`` bytes.

        The last ``reserve`` places of the window are for replies.
        """
        batch: list[Outgoing] = []
        if not self.online or not any(self._lines.rings):
            return batch
        for kind, ring in zip(DURABLE, self._lines.rings, strict=True):
            most = window if kind is REPLY else window - reserve
            if kind is not REPLY and now < self._durable_from:
                break
            while ring and len(batch) < most and size > 0:
                line = ring.popleft()
                line.queued = False
                size -= self._take(line, batch, min(most, len(batch) + BURST), size, now)
                if not line.quiet:
                    self._lines.stand(line)
                    self._lines.forget(line)
        return batch

    def _take(self, line: TopicQueue, batch: list[Outgoing], most: int, size: int, now: float) -> int:
        """Move messages of a topic into the batch; return their bytes."""
        taken = 0
        while line.sendable and len(batch) < most and taken < size:
            message = line.pop()
            if message.gone:
                continue
            if message.deadline is not None and message.deadline <= now:
                self._contents.lose(message, Reason.AGE, message.expires)
                continue
            self._contents.take(line, message)
            taken += message.size
            batch.append(message)
        return taken

    def settle(self, message: Outgoing, outcome: Outcome, now: float, wall: float) -> None:
        """Apply the broker's acknowledgement of an in-flight message."""
        line = self._lines[message.topic]
        line.flying -= 1
        if outcome is _HELD:
            self._contents.take_back(line, message)
            self._lines.holds.unheard(line, now)
            return
        if outcome is _REFUSED:
            self.losses.note(message.topic, message.traffic, Reason.REFUSED, wall)
        self._contents.forget(message)
        if not line.quiet:
            self._lines.holds.heard(line, now)
            self._lines.stand(line)
            self._lines.forget(line)

    def put_back(self, messages: Iterable[Outgoing]) -> None:
        """Take back the messages, oldest first, that were in flight when the connection ended."""
        oldest_first = list(messages)
        for message in reversed(oldest_first):
            line = self._lines[message.topic]
            line.flying -= 1
            self._contents.take_back(line, message)
        for message in oldest_first:
            self._lines.stand(self._lines[message.topic])

    def go_online(self, now: float) -> None:
        """Start a new connection; every topic is probed for subscribers again."""
        self._lines.online = True
        self._durable_from = now + NEWEST_FIRST if self.waiting else now
        self._lines.holds.clear()
        for line in self._lines.values():
            line.see(TopicEvent.CONNECTED)
            self._lines.stand(line)

    def go_offline(self) -> None:
        """Record the end of the connection."""
        self._lines.online = False
        self._lines.needs_fetch.clear()

    def tick(self, now: float, wall: float) -> None:
        """Drop expired messages, and retry held topics that are due."""
        for message in self._memory.late(now):
            self._lines.forget(self._contents.lose(message, Reason.AGE, wall))
        for line in self._lines.holds.due(now):
            self._lines.stand(line)

    def close(self) -> None:
        """Drop the messages in memory."""
        for message in self._memory.all():
            self._memory.remove(message)
        self._contents.waiting = 0

    @property
    def online(self) -> bool:
        """True while there is a connection."""
        return self._lines.online

    @property
    def idle(self) -> bool:
        """True when there is nothing to send now."""
        return not (any(self._lines.rings) or self._lines.needs_fetch)

    @property
    def held(self) -> int:
        """The number of topics that wait for a subscriber."""
        return len(self._lines.holds)

    @property
    def unheard(self) -> int:
        """The number of messages that wait for a subscriber of their topic."""
        return self._lines.holds.messages

    def standing(self) -> dict[TrafficClass, ClassStatistics]:
        """Return the statistics of each class."""
        return class_statistics(self._lines.values())
