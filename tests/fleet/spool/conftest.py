import pytest

from fleet.spool.contents import SpoolContents
from fleet.spool.disk_exchange import DiskExchange
from fleet.spool.losses import Reason
from fleet.spool.message import DeliveryOutcome, Outgoing
from fleet.spool.queue import NEWEST_FIRST, SpoolQueue
from fleet.spool.spool import AGES, Spool, SpoolSettings
from fleet.spool.unwritten import GRACE
from fleet.testing.clock import ManualClock
from fleet.wire.rules import TrafficClass
from tests.tools.waiting import wait_until


class Opened:
    """A spool on disk, and the broker that takes what it sends."""

    def __init__(self, folder, clock, **settings):
        self.clock = clock
        self.spool = Spool(SpoolSettings(folder=folder, **settings), clock)

    def put(self, *payloads, topic="t", traffic=TrafficClass.EVENT):
        for payload in payloads:
            assert self.spool.put(Outgoing(topic, payload, 1, traffic))
        return self

    def written(self):
        """Wait until everything is on disk."""
        wait_until(
            "everything is on disk", lambda: not self.spool._queue.disk.unwritten or self.spool.problem
        )
        return self

    def online(self):
        self.spool.go_online()
        self.clock.advance(1.0)
        return self

    def send(self):
        """Send and acknowledge what may go now."""
        batch = self.spool.take(self.clock.monotonic(), window=100, reserve=0, size=10**6)
        self.spool.settle([(message, DeliveryOutcome.ACKED) for message in batch])
        return [(message.topic, message.payload) for message in batch]

    def drain(self):
        """Send until nothing waits."""
        sent = []

        def nothing_waits():
            sent.extend(self.send())
            return not self.spool.waiting

        wait_until("nothing waits", nothing_waits)
        return sent


class Bench:
    """A queue, its disk (a dictionary), its time, and the broker that takes what it sends."""

    wall = 1_800_000_000.0

    def __init__(self, *, messages=5, size=10**6, disk=True, first=0):
        self.now = 1000.0
        self.rows = {}
        self.queue = SpoolQueue(messages, size, AGES, disk=disk, first=first)
        self.put_count = 0

    def put(self, topic="t", traffic=TrafficClass.EVENT, payload=b"", **more):
        message = Outgoing(topic, payload or b"%d" % self.put_count, 1, traffic, **more)
        self.put_count += 1
        return self.queue.put(message, self.now, self.wall)

    def online(self):
        self.queue.go_online(self.now)
        self.now += NEWEST_FIRST
        return self

    def take(self, window=100, reserve=0):
        return self.queue.take(self.now, window=window, reserve=reserve, size=10**6)

    def send(self, window=100, outcome=DeliveryOutcome.ACKED):
        """Send what may go and have the broker answer; return the payloads."""
        batch = self.take(window)
        for message in batch:
            self.queue.settle(message, outcome, self.now, self.wall)
        return [message.payload for message in batch]

    def drain(self):
        """Send and fetch until nothing more comes."""
        sent = []
        while part := [*self.send(), *(self.disk() or self.send())]:
            sent += part
        return sent

    def disk(self, *, works=True):
        """Do what the disk's thread does in one turn."""
        self.commit(self.queue.disk.work(self.now), works=works)
        if works:
            self.fetch()

    def commit(self, work, *, works=True):
        """End a change of the disk, which may have taken long."""
        if not works:
            self.queue.disk.not_written(work)
            return
        for message in work.rows:
            self.rows[message.seq] = message
        for seq in work.done:
            self.rows.pop(seq, None)
        self.queue.losses.changed = False
        self.queue.disk.wrote(work)

    def evict(self, count):
        """Remove the oldest rows, as is done to make room on disk."""
        removed = {}
        for seq in sorted(self.rows)[:count]:
            removed.setdefault(self.rows.pop(seq).topic, []).append(seq)
        for topic, seqs in removed.items():
            self.queue.disk.removed(topic, seqs, Reason.ROOM, self.wall)

    def fetch(self):
        """Bring back from disk what is wanted."""
        for fetch in self.queue.disk.fetches():
            found = [
                Outgoing(
                    row.topic,
                    row.payload,
                    1,
                    row.traffic,
                    seq=row.seq,
                    stored=True,
                    since=self.now,
                    deadline=self.now + row.expires - self.wall,
                )
                for row in sorted(self.rows.values(), key=lambda row: row.seq)
                if row.topic == fetch.topic and row.seq > fetch.after
            ]
            part = found[: fetch.limit]
            self.queue.disk.fetched(fetch.topic, part, more=len(part) == fetch.limit)

    def restarted(self, messages=5, *, there=True):
        """Return what a new process makes of the disk, or of its memory when no disk is ``there``."""
        other = Bench(messages=messages, first=max(self.rows, default=0))
        other.rows, other.now, other.put_count = self.rows, self.now, self.put_count
        other.look(there=there)
        return other

    def look(self, *, there):
        """Read the disk for the first time, or find that it cannot be read."""
        if not there:
            self.queue.disk.disk_missing()
            return
        for topic in dict.fromkeys(row.topic for row in self.rows.values()):
            rows = [row for row in self.rows.values() if row.topic == topic]
            seqs = [row.seq for row in rows]
            self.queue.disk.found(topic, rows[0].traffic, len(rows), min(seqs), max(seqs))

    def live(self, topic):
        """Return what stands in memory of a topic, but what is on disk alone."""
        queue = self.queue._queues.get(topic)
        return [one for one in (*queue.back, *queue.memory) if not one.gone] if queue else []

    def on_disk(self, topic):
        queue = self.queue._queues.get(topic)
        return queue.on_disk if queue else 0

    def lost(self, topic):
        return sum(gap.lost for gap in self.queue.losses.known() if gap.topic == topic)


class ExchangeBench:
    """The contents of a spool while connected, and the disk thread's view of them."""

    def __init__(self):
        self.contents = SpoolContents(1000, 10**7, keeps_on_disk=True)
        self.queues = self.contents.queues
        self.queues.online = True
        self.disk = DiskExchange(self.contents, 0)

    def add(self, *seqs, topic="t", on_disk=False, since=0.0):
        queue = self.queues.of(topic, TrafficClass.EVENT)
        messages = [Outgoing(topic, b"", 1, seq=seq, since=since, on_disk=on_disk) for seq in seqs]
        for message in messages:
            self.contents.add(queue, message)
        return messages

    def written(self, now=GRACE):
        """Write what is due; return it."""
        work = self.disk.work(now)
        self.disk.wrote(work)
        return work

    def fly(self, topic="t"):
        """Send one message, which is not acknowledged yet."""
        queue = self.queues[topic]
        message = queue.pop()
        self.contents.take(queue, message)
        return message

    @property
    def counts(self):
        """How many wait, how many of them on disk only, and how many messages memory has."""
        return self.contents.waiting, self.contents.on_disk, self.contents.memory.count


@pytest.fixture
def exchange():
    """Give the disk thread's view of an empty spool."""
    return ExchangeBench()


@pytest.fixture
def make_bench():
    """Make queues with their disks."""
    return Bench


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def opened(tmp_path, clock):
    """Open the spool of a new process; the one before is closed first."""
    made = []

    def opened(folder=tmp_path / "state", clock=clock, **settings):
        if made:
            made[-1].spool.close()
        made.append(Opened(folder, clock, **settings))
        return made[-1]

    yield opened
    for each in made:
        each.spool.close()
