import array
import fcntl
import socket
import termios
import threading

import pytest

from fleet.errors import LinkLost
from fleet.link.latest_motion import LatestMotion
from fleet.link.stream import StreamLink
from fleet.testing.clock import ManualClock

FAST, SLOW, STOP = b"M 9\n", b"M 1\n", b"HALT\n"


class Wire:
    """A link that keeps what it is told; ``waiting`` bytes have not left."""

    def __init__(self):
        self.url, self.said, self.waiting, self.lost_now = "wire", [], 0, False
        self.dropping = False  # as a datagram link without a peer

    def send(self, data, address=None):
        if self.lost_now:
            raise LinkLost("gone")
        self.said.append(data)
        return not self.dropping

    def unsent(self):
        return self.waiting


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def slot(wire, clock):
    return LatestMotion(wire, clock)


def test_motion_goes_out_at_once_on_a_free_line(slot, wire):
    assert slot.put((FAST,), slot.turn)
    assert wire.said == [FAST]


def test_only_the_newest_motion_is_written_when_the_line_is_free_again(slot, wire):
    wire.waiting = 5
    slot.put((FAST,), slot.turn)
    slot.put((SLOW,), slot.turn)
    slot.flush()
    assert wire.said == []
    wire.waiting = 4
    slot.flush()
    slot.flush()
    assert wire.said == [SLOW]
    assert slot.superseded == 1


def test_a_stop_overtakes_what_waits_and_what_was_decided_before_it(slot, wire):
    wire.waiting = 100
    decided = slot.turn
    slot.put((FAST,), decided)
    assert slot.halt((STOP,))
    wire.waiting = 0
    slot.flush()
    assert not slot.put((FAST,), decided)
    assert wire.said == [STOP]


def test_motion_keeps_to_the_pace_of_the_line_where_the_kernel_does_not_tell(wire, clock):
    slot = LatestMotion(wire, clock, baud=1000)  # 10 ms a byte
    for _ in range(10):
        slot.put((FAST,), slot.turn)
    assert len(wire.said) == 2  # one on the line, one may wait
    clock.advance(0.04)
    slot.flush()
    assert len(wire.said) == 3


def test_what_must_not_be_replaced_does_not_wait_and_nothing_older_follows_it(slot, wire):
    wire.waiting = 100
    slot.put((FAST,), slot.turn)
    assert slot.put((b"DOCK\n",), slot.turn, at_once=True)
    wire.waiting = 0
    slot.flush()
    assert wire.said == [b"DOCK\n"]


def test_frames_that_belong_together_are_written_one_by_one_and_wait_together(slot, wire):
    wire.waiting = 9
    slot.put((FAST, SLOW), slot.turn)
    wire.waiting = 8
    slot.flush()
    assert wire.said == [FAST, SLOW]


def test_a_halt_on_a_link_that_is_gone_says_so_and_does_not_fail(slot, wire):
    wire.lost_now = True
    assert not slot.halt((STOP,))
    with pytest.raises(LinkLost):
        slot.put((FAST,), slot.turn)


def test_a_halt_that_a_link_drops_is_not_called_written(slot, wire):
    assert slot.halt((STOP, STOP))
    wire.dropping = True
    assert not slot.halt((STOP, STOP))
    assert wire.said == [STOP] * 4


def test_a_halt_comes_from_any_thread(slot, wire):
    thread = threading.Thread(target=slot.halt, args=((STOP,),))
    thread.start()
    thread.join()
    assert wire.said == [STOP]


def bytes_in(end):
    count = array.array("i", [0])
    fcntl.ioctl(end.fileno(), termios.FIONREAD, count)
    return count[0]


async def test_a_robot_that_does_not_read_finds_one_frame_and_not_the_past(clock):
    ours, robot = socket.socketpair()
    ours.setblocking(False)
    link = StreamLink(
        "pair", ours.fileno(), lambda *_: None, backlog=1 << 20, close_descriptor=lambda _: ours.close()
    )
    slot = LatestMotion(link, clock)
    for _ in range(1000):
        slot.put((FAST,), slot.turn)
    assert 0 < bytes_in(robot) <= 2 * len(FAST)
    assert slot.superseded > 900
    await link.close()
    robot.close()
