"""The bytes on the links of a process, on the bus only while somebody listens."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.process.frame_publisher import EVERY, FramePublisher
from fleet.link.tap import LinkFrames
from fleet.testing.clock import ManualClock


class Session:
    """A bus session with one publisher."""

    def __init__(self):
        self.wanted = False
        self.heard = []
        self.key = ""

    def publisher(self, key):
        self.key = key
        return self

    def put(self, payload):
        self.heard.append(msgspec.json.decode(payload, type=LinkFrames))


@pytest.fixture
def session():
    return Session()


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def publisher(session, clock):
    return FramePublisher(keys.frames("yard", "main"), session, clock)


def turn(publisher, clock):
    """Let a turn of the scheduler end."""
    list(publisher.flushing())
    clock.advance(EVERY)


def test_links_copy_nothing_until_somebody_listens_and_nothing_afterwards(publisher, session, clock):
    tap = publisher.opening("rex", lambda: None)("memory:rex")
    turn(publisher, clock)
    assert tap.note is None
    session.wanted = True
    turn(publisher, clock)
    tap.note("out", b"go")
    turn(publisher, clock)
    session.wanted = False
    turn(publisher, clock)
    assert tap.note is None
    assert [(message.robot, message.link, message.frames[0].data) for message in session.heard] == [
        ("rex", "memory:rex", b"go")
    ]


def test_it_looks_ten_times_a_second_at_the_most(publisher, session):
    session.wanted = True
    list(publisher.flushing())
    tap = publisher.opening("rex", lambda: None)("memory:rex")
    list(publisher.flushing())
    assert (tap.note is not None, session.heard) == (True, [])
