"""A byte stream: what is sent and received, and how and why it ends."""

import asyncio
import os
import socket
import threading

import pytest

from fleet.errors import LinkLost
from fleet.link import stream
from fleet.link.stream import StreamLink

URL = "tcp:robot:1"


@pytest.fixture
async def pair(receiver):
    """Return a link on one end of a pair of sockets, what it receives, and the robot at the other end."""
    ours, robot = socket.socketpair()
    ours.setblocking(False)
    robot.setblocking(False)
    received, closed = receiver(), []

    def close(discard):
        closed.append(discard)
        ours.close()

    link = StreamLink(URL, ours.fileno(), received, backlog=1000, close_descriptor=close)
    link.closed_with = closed
    yield link, received, robot
    await link.close()
    robot.close()


async def test_bytes_go_to_the_robot_and_come_from_it(pair):
    link, received, robot = pair
    assert link.send(b"halt")
    assert robot.recv(100) == b"halt"
    robot.send(b"ok")
    await received.until(b"ok")
    assert received.addresses == [None]
    assert (link.stats.sent, link.stats.received, link.stats.dropped) == (1, 1, 0)


async def test_a_thread_may_send_while_the_loop_is_blocked(pair):
    link, _, robot = pair
    thread = threading.Thread(target=link.send, args=(b"halt",))
    thread.start()
    thread.join()  # the loop does not run meanwhile
    assert robot.recv(100) == b"halt"


async def test_a_backlog_beyond_the_bound_ends_the_link_and_sends_nothing_more(pair, monkeypatch):
    link, _, robot = pair
    monkeypatch.setattr(stream, "_unsent", lambda _: 1000)
    assert link.send(b"1")
    monkeypatch.setattr(stream, "_unsent", lambda _: 1001)
    with pytest.raises(LinkLost, match=f"{URL}: the robot does not read: 1001 bytes wait for it"):
        link.send(b"2")
    monkeypatch.setattr(stream, "_unsent", lambda _: 0)
    with pytest.raises(LinkLost, match="the robot does not read"):
        link.send(b"3")
    assert robot.recv(100) == b"1"
    assert (link.stats.sent, link.stats.dropped) == (1, 1)


@pytest.mark.parametrize("taken", [None, 0, 2])
async def test_a_part_of_a_frame_ends_the_link_because_it_cannot_be_taken_back(pair, monkeypatch, taken):
    link, _, _ = pair

    def write(_descriptor, _data):
        if taken is None:
            raise BlockingIOError
        return taken

    with monkeypatch.context() as full:
        full.setattr(stream.os, "write", write)
        with pytest.raises(LinkLost, match="the robot does not read: its transmit buffer is full"):
            link.send(b"abc")
    assert (link.stats.sent, link.stats.dropped) == (0, 1)


async def test_a_device_that_fails_while_it_is_written_ends_the_link_with_its_reason(
    pair, monkeypatch, loss_reason
):
    link, _, _ = pair

    def fail(*_):
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as unplugged:
        unplugged.setattr(stream.os, "write", fail)
        with pytest.raises(LinkLost, match=f"{URL}: Input/output error"):
            link.send(b"abc")
    assert await loss_reason(link) == f"{URL}: Input/output error"


async def test_the_unsent_bytes_are_those_in_the_kernel_and_none_once_the_link_has_ended(pair, monkeypatch):
    link, _, _ = pair
    monkeypatch.setattr(stream, "_unsent", lambda descriptor: 7 if descriptor == link.fileno() else 0)
    assert link.unsent() == 7
    await link.close()
    assert link.unsent() == 0


async def test_a_device_that_is_gone_has_no_unsent_bytes_and_ends_the_link(pair, monkeypatch, loss_reason):
    link, _, _ = pair

    def fail(_):
        raise OSError(19, "No such device")

    monkeypatch.setattr(stream, "_unsent", fail)
    assert link.unsent() == 0
    assert await loss_reason(link) == f"{URL}: No such device"


async def test_the_kernel_counts_what_the_robot_has_not_read():
    ours, robot = socket.socketpair()
    with ours, robot:
        assert stream._unsent(ours.fileno()) == 0
        ours.send(b"x" * 100)
        assert stream._unsent(ours.fileno()) > 0


async def test_the_other_side_ends_the_link(pair, loss_reason):
    link, received, robot = pair
    robot.send(b"bye")
    robot.close()
    assert await loss_reason(link) == f"{URL}: the other side closed it"
    assert received.data == b"bye"
    with pytest.raises(LinkLost, match="the other side closed it"):
        link.send(b"x")
    watched = asyncio.get_running_loop().remove_reader(link.fileno())
    assert not watched, "a dead descriptor stays readable for ever"


@pytest.mark.parametrize("error", [BlockingIOError(), InterruptedError()])
async def test_a_false_alarm_of_the_loop_is_no_end(pair, monkeypatch, error):
    link, received, robot = pair
    alarms, real = [error], os.read

    def read(descriptor, size):
        if alarms and descriptor == link.fileno():
            raise alarms.pop()
        return real(descriptor, size)

    monkeypatch.setattr(stream.os, "read", read)
    robot.send(b"ok")
    await received.until(b"ok")
    assert (link.stats.received, alarms) == (1, [])


async def test_a_device_that_fails_while_it_is_read_ends_the_link(pair, monkeypatch, loss_reason):
    link, _, robot = pair

    def fail(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(stream.os, "read", fail)
    robot.send(b"x")
    assert await loss_reason(link) == f"{URL}: Input/output error"
    assert link.stats.received == 0


@pytest.mark.parametrize("fallen", [True, False])
async def test_a_link_is_closed_once_and_discards_unsent_bytes_only_when_it_was_down(
    pair, loss_reason, fallen
):
    link, received, robot = pair
    if fallen:
        robot.close()
        await loss_reason(link)
    await link.close()
    await link.close()
    assert link.closed_with == [fallen]
    with pytest.raises(LinkLost, match="closed"):
        link.send(b"x")
    assert received.data == b""


async def test_nothing_is_received_after_it_is_closed(pair):
    link, received, robot = pair
    robot.send(b"late")
    await link.close()
    await asyncio.sleep(0)
    assert received.data == b""


async def test_frames_are_copied_for_a_recorder(pair):
    link, received, robot = pair
    noted = []
    link._tap.note = lambda direction, data: noted.append((direction, data))
    link.send(b"halt")
    robot.send(b"ok")
    await received.until(b"ok")
    assert noted == [("out", b"halt"), ("in", b"ok")]
