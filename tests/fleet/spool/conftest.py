import pytest

from fleet.spool.message import Outcome, Outgoing
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock
from fleet.testing.waiting import wait_until
from fleet.wire.rules import Traffic


class Opened:
    """A spool on disk, and the broker that takes what it sends."""

    def __init__(self, folder, clock, **settings):
        self.clock = clock
        self.spool = Spool(SpoolSettings(folder=folder, **settings), clock)

    def put(self, *payloads, topic="t", traffic=Traffic.EVENT):
        for payload in payloads:
            assert self.spool.put(Outgoing(topic, payload, 1, traffic))
        return self

    def written(self):
        """Wait until everything is on disk."""
        wait_until("everything is on disk", lambda: not self.spool._queue.unwritten or self.spool.problem)
        return self

    def online(self):
        self.spool.go_online()
        self.clock.advance(1.0)
        return self

    def send(self):
        """Send and acknowledge what may go now."""
        batch = self.spool.take(self.clock.monotonic(), window=100, reserve=0, size=10**6)
        self.spool.settle([(message, Outcome.ACKED) for message in batch])
        return [(message.topic, message.payload) for message in batch]

    def drain(self):
        """Send until nothing waits."""
        sent = []

        def nothing_waits():
            sent.extend(self.send())
            return not self.spool.waiting

        wait_until("nothing waits", nothing_waits)
        return sent


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
