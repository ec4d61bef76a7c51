"""What is sent next, what goes to disk, what is dropped: the spool's decisions, without I/O and clock.

A message stands in memory and, when nobody has taken it for a moment, on disk too. Beyond the bound on
memory it stands on disk alone (cold) and comes back when its turn is near. Order is kept in each topic.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from fleet.spool.disk_work import DiskWork, FetchRequest
from fleet.spool.losses import Losses, Reason
from fleet.spool.memory_buffer import DURABLE, MemoryBuffer
from fleet.spool.message import Outcome, Outgoing
from fleet.spool.pending_deletions import PendingDeletions
from fleet.spool.statistics import SECOND, ClassStatistics, class_statistics
from fleet.spool.topic_queue import REPLY, TopicEvent, TopicQueue
from fleet.spool.topic_queues import LOW_IN_NEED, TopicQueues
from fleet.spool.unwritten import UnwrittenMessages
from fleet.wire.rules import TrafficClass

NEWEST_FIRST = 0.1
"""Seconds after a connect in which what has waited lets the newest state go first."""
FETCHED = 256
"""Messages of a topic that one fetch brings at most, LOW_IN_NEED when memory is full."""
BURST = 16
"""Messages of one topic that go before another topic has its turn."""
_HELD, _REFUSED = Outcome.HELD, Outcome.REFUSED


class SpoolQueue:
    """All durable messages of one edge. Times are monotonic seconds, ``wall`` is Unix time.

    ``messages`` and ``size`` (bytes) bound what stands in memory. ``first``: what the numbers begin after.
    ``before``: the newest number of an earlier process, and of all before it.
    """

    def __init__(
        self, messages: int, size: int, ages: Mapping[TrafficClass, float], *, disk: bool, first: int = 0
    ) -> None:
        self.waiting = 0
        self.on_disk = 0
        self.losses = Losses()
        self.failing = False  # no disk takes what is to be written
        self._disk = disk
        self._ages = [ages[kind] for kind in DURABLE]  # lists: a dictionary hashes an enumeration slowly
        self._memory = MemoryBuffer(messages, size)
        self._lines = TopicQueues(self._memory)
        self._unwritten = UnwrittenMessages()
        self._done = PendingDeletions()
        self._writing = False
        self._seq = self.before = first
        self._lasting_from = float("-inf")

    # -- in and out ----------------------------------------------------------------------------------

    def put(self, message: Outgoing, now: float, wall: float) -> bool:
        """Take a message; return False when it is larger, or matters less, than all there is room for."""
        age = self._ages[message.traffic]
        if message.expiry is not None:
            age = min(age, message.expiry)
        message.since, message.deadline, message.expires = now, now + age, wall + age
        self._seq = message.seq = max(self._seq + 1, int(wall * SECOND))
        line = self._lines.of(message.topic, message.traffic)
        fits = self._memory.fits(message)
        message.on_disk = bool(line.on_disk) or (self._disk and not self.failing and not fits)
        share = 1 if self.failing or not message.on_disk else 2
        if not (fits or self._make_room(line, message, share, wall)):
            self._lines.forget(line)
            self.losses.note(message.topic, message.traffic, Reason.ROOM, wall)
            return False
        self.waiting += 1
        self._memory.add(message)
        if message.on_disk:
            line.cold_from = line.cold_from if line.on_disk else message.seq
            line.on_disk += 1
            self.on_disk += 1
        else:
            line.memory.append(message)
            line.loaded = message.seq
        if self._disk:
            self._unwritten.add(message)
        self._lines.stand(line)
        return True

    def take(self, now: float, *, window: int, reserve: int, size: int) -> list[Outgoing]:
        """Remove and return what may be written next, at most ``window`` messages and about ``size`` bytes.

        The last ``reserve`` of the window are for replies.
        """
        batch: list[Outgoing] = []
        if not self.online or not any(self._lines.rings):
            return batch
        for kind, ring in zip(DURABLE, self._lines.rings, strict=True):
            most = window if kind is REPLY else window - reserve
            if kind is not REPLY and now < self._lasting_from:
                break
            while ring and len(batch) < most and size > 0:
                line = ring.popleft()
                line.queued = False
                size -= self._take(line, batch, min(most, len(batch) + BURST), size, now)
                if not line.quiet:
                    self._lines.stand(line)
                    self._lines.forget(line)
        return batch

    def settle(self, message: Outgoing, outcome: Outcome, now: float, wall: float) -> None:
        """Take what the broker said of a message that was taken."""
        line = self._lines[message.topic]
        line.flying -= 1
        if outcome is _HELD:
            self._return(line, message)
            self._lines.holds.unheard(line, now)
            return
        if outcome is _REFUSED:
            self.losses.note(message.topic, message.traffic, Reason.REFUSED, wall)
        self._forget(message)
        if not line.quiet:
            self._lines.holds.heard(line, now)
            self._lines.stand(line)
            self._lines.forget(line)

    def put_back(self, messages: Iterable[Outgoing]) -> None:
        """Take back messages, oldest first, that were under way when the connection ended."""
        oldest_first = list(messages)
        for message in reversed(oldest_first):
            line = self._lines[message.topic]
            line.flying -= 1
            self._return(line, message)
        for message in oldest_first:
            self._lines.stand(self._lines[message.topic])

    def go_online(self, now: float) -> None:
        """Begin a new connection: nobody knows yet who hears."""
        self._lines.online = True
        self._lasting_from = now + NEWEST_FIRST if self.waiting else now
        self._lines.holds.clear()
        for line in self._lines.values():
            line.see(TopicEvent.CONNECTED)
            self._lines.stand(line)

    def go_offline(self) -> None:
        """Note the end of the connection."""
        self._lines.online = False
        self._lines.needs_fetch.clear()

    def tick(self, now: float, wall: float) -> None:
        """Look after time: what is too old is dropped, what was held is tried again."""
        for message in self._memory.late(now):
            self._lines.forget(self._lose(message, Reason.AGE, wall))
        for line in self._lines.holds.due(now):
            self._lines.stand(line)

    def close(self) -> None:
        """Drop what stands in memory."""
        for message in self._memory.all():
            self._memory.remove(message)
        self.waiting = 0

    @property
    def online(self) -> bool:
        """True while there is a connection."""
        return self._lines.online

    @property
    def idle(self) -> bool:
        """True when nothing could be sent now."""
        return not (any(self._lines.rings) or self._lines.needs_fetch)

    @property
    def held(self) -> int:
        """How many topics wait for somebody to hear them."""
        return len(self._lines.holds)

    @property
    def unheard(self) -> int:
        """How many messages wait for somebody to hear their topics."""
        return self._lines.holds.messages

    def standing(self) -> dict[TrafficClass, ClassStatistics]:
        """Return what waits of each class."""
        return class_statistics(self._lines.values())

    # -- the disk ------------------------------------------------------------------------------------

    @property
    def needs_fetch(self) -> bool:
        """True when messages are wanted from disk."""
        return bool(self._lines.needs_fetch)

    @property
    def unwritten(self) -> bool:
        """True when something is being changed on disk, or is to be soon.

        Any thread may look: each is looked at once, and what is being written last, for it is marked first.
        """
        return len(self._unwritten) > 0 or len(self._done) > 0 or self.losses.changed or self._writing

    def work(self, now: float) -> DiskWork:
        """Remove and return what is to be changed on disk now."""
        self._writing = True
        rows = self._unwritten.take(now, at_once=not self.online or self.on_disk > 0)
        done = self._done.take()
        self._writing = bool(rows or done)
        return DiskWork(rows, done)

    def wrote(self, work: DiskWork) -> None:
        """Note that a change is on disk: what is cold has left memory."""
        self.failing = self._writing = False
        self._done.deleted()
        for message in work.rows:
            if message.on_disk and not message.gone:
                message.gone = True
                self._memory.remove(message)

    def not_written(self, work: DiskWork) -> None:
        """Take a change back that the disk did not take."""
        self._done.put_back()
        self._unwritten.put_back(work.rows)
        self.failing, self._writing = True, False

    def fetches(self) -> list[FetchRequest]:
        """Return of which topics more is wanted."""
        share = self._memory.room // max(1, len(self._lines.needs_fetch))
        limit = max(LOW_IN_NEED, min(FETCHED, share))
        return [
            FetchRequest(line.topic, line.traffic, line.loaded, limit)
            for line in self._lines.needs_fetch.values()
        ]

    def fetched(self, topic: str, messages: Sequence[Outgoing], *, more: bool) -> None:
        """Take messages from disk; ``more``: there are further ones. The last ones never reached the disk."""
        line = self._lines.needs_fetch.pop(topic, None)
        if line is None:
            return
        for message in messages:
            if self._is_cold(line, message.seq):
                self._warm(line, message)
                self._memory.add(message)
        if messages:  # also when none was cold: the next fetch goes on behind them
            line.loaded = max(line.loaded, messages[-1].seq)
        if not more:
            self._warm_unwritten((topic,))
        self._lines.stand(line)
        self._lines.forget(line)

    def found(self, topic: str, traffic: TrafficClass, count: int, oldest: int, newest: int) -> None:
        """Note what an earlier process left on disk; what came before the disk could be read follows it."""
        self._seq = max(self._seq, newest)
        self.before = max(self.before, newest)
        line = self._lines.of(topic, traffic)
        live = [message for message in line.memory if not message.gone]
        for message in live:
            message.on_disk = True
        line.memory.clear()
        line.loaded, line.cold_from = 0, oldest
        if line.flying or line.back:
            mine = (one for one in self._unwritten if one.topic == topic and not (one.gone or one.on_disk))
            line.ahead = frozenset(one.seq for one in mine)
        line.on_disk += len(live) + count
        self.on_disk += len(live) + count
        self.waiting += count
        self._lines.stand(line)

    def removed(self, topic: str, seqs: Sequence[int], reason: Reason, wall: float) -> None:
        """Note that messages were removed from disk: those that are not under way are lost."""
        line = self._lines.get(topic)
        if line is None:
            return
        if lost := sum(self._is_cold(line, seq) for seq in seqs):
            self._cool(line, lost, reason, wall)
            line.cold_from = max(line.cold_from, *seqs)
        removed = set(seqs)
        for message in (*line.back, *line.memory):
            if message.seq in removed and not message.gone:
                self._lose(message, reason, wall)
        self._lines.forget(line)

    def lost_disk(self, wall: float) -> None:
        """Note that what was on disk is lost; what is in memory is written anew."""
        for line in list(self._lines.values()):
            kept = sum(one.topic == line.topic and one.on_disk and not one.gone for one in self._unwritten)
            if line.on_disk > kept:
                self._cool(line, line.on_disk - kept, Reason.CORRUPT, wall)
            for message in (*line.back, *line.memory):
                if message.stored and not message.gone:
                    message.stored = False
                    self._unwritten.add(message)
            self._lines.forget(line)
        self._done.clear()

    def _is_cold(self, line: TopicQueue, seq: int) -> bool:
        """Tell whether a row that was met on disk is one that stands there alone."""
        return seq > line.loaded and seq not in self._done and seq not in line.ahead

    def no_disk(self) -> None:
        """Note that there is no file at all: memory alone serves, also for what was to leave it."""
        self.failing = True
        if self.on_disk:
            self._warm_unwritten(self._lines)
            for line in self._lines.values():
                self._lines.stand(line)

    def _cool(self, line: TopicQueue, lost: int, reason: Reason, wall: float) -> None:
        """Count out messages that were on disk alone."""
        line.on_disk -= lost
        self.on_disk -= lost
        self.waiting -= lost
        self.losses.note(line.topic, line.traffic, reason, wall, lost)
        self._lines.stand(line)

    # -- within --------------------------------------------------------------------------------------

    def _take(self, line: TopicQueue, batch: list[Outgoing], most: int, size: int, now: float) -> int:
        """Move messages of a line into the batch; return their bytes."""
        taken = 0
        while line.sendable and len(batch) < most and taken < size:
            message = line.pop()
            if message.gone:
                continue
            if message.deadline is not None and message.deadline <= now:
                self._lose(message, Reason.AGE, message.expires)
                continue
            self._memory.remove(message)
            self.waiting -= 1
            line.flying += 1
            taken += message.size
            batch.append(message)
        return taken

    def _return(self, line: TopicQueue, message: Outgoing) -> None:
        """Put a message back that was under way."""
        if message.gone:
            return
        line.give_back(message)
        self._memory.add_again(message)
        self.waiting += 1

    def _warm(self, line: TopicQueue, message: Outgoing) -> None:
        """Have a cold message stand in memory."""
        message.on_disk = False
        line.memory.append(message)
        line.loaded = line.cold_from = message.seq
        line.on_disk -= 1
        self.on_disk -= 1

    def _warm_unwritten(self, topics: Container[str]) -> None:
        """Have those of some topics stand in memory that never reached the disk."""
        for message in self._unwritten:
            if message.on_disk and not message.gone and message.topic in topics:
                self._warm(self._lines[message.topic], message)

    def _forget(self, message: Outgoing) -> None:
        """Nobody waits for a message any more."""
        message.gone = True
        if message.stored:
            self._done.add(message.seq)
        elif self._disk:
            self._unwritten.tombstone()

    def _make_room(self, line: TopicQueue, message: Outgoing, share: int, wall: float) -> bool:
        """Push out what is older and matters no more than a message of a line; tell whether it fits then."""
        if not self._memory.can_fit(message, share):
            return False
        for oldest in self._memory.in_the_way(message, share):
            other = self._lose(oldest, Reason.ROOM, wall)
            if other is not line:
                self._lines.forget(other)
        return True

    def _lose(self, message: Outgoing, reason: Reason, wall: float) -> TopicQueue:
        """Drop a message that stood in memory; return its line, which may be empty now."""
        line = self._lines[message.topic]
        self._memory.remove(message)
        self._forget(message)
        self.waiting -= 1
        if message.on_disk:
            line.on_disk -= 1
            self.on_disk -= 1
        line.shed()
        self.losses.note(message.topic, message.traffic, reason, wall)
        return line
