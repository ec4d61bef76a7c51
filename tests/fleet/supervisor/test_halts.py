"""What halts a robot whose process has died, written to real sockets and devices."""

import contextlib
import os
import pty
import socket
import tty

import pytest

from fleet.link.gate import boot_time
from fleet.supervisor.halts import HALT_MARGIN, ProcessHalts, RegisteredHalt, registered_halt
from fleet.supervisor.protocol import WriteUntil


@pytest.fixture
def device():
    """Return both ends of a serial device: the robot's, and ours."""
    robot, ours = pty.openpty()
    tty.setraw(ours)
    yield robot, ours
    os.close(robot)


def test_a_halt_is_written_to_a_serial_device(device):
    robot, ours = device
    halts = ProcessHalts()
    halts.store("rex", registered_halt(ours, (b"halt\n", b"brake\n"), None))
    assert halts.write() == ["rex"]
    heard = b""
    while len(heard) < len(b"halt\nbrake\n"):  # each write may come by itself
        heard += os.read(robot, 100)
    assert heard == b"halt\nbrake\n"
    halts.close()


def test_a_halt_goes_to_its_address():
    with socket.socket(type=socket.SOCK_DGRAM) as robot, socket.socket(type=socket.SOCK_DGRAM) as ours:
        robot.bind(("127.0.0.1", 0))
        halts = ProcessHalts()
        halts.store("rex", registered_halt(os.dup(ours.fileno()), (b"halt",), robot.getsockname()))
        assert halts.write() == ["rex"]
        assert robot.recv(100) == b"halt"
        halts.close()


def test_a_robot_that_does_not_read_keeps_no_other_from_its_halt():
    stuck, other = socket.socketpair(), socket.socketpair()
    stuck[0].setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            stuck[0].send(b"x" * 4096)
    halts = ProcessHalts()
    for name, pair in (("stuck", stuck), ("other", other)):
        halts.store(name, registered_halt(os.dup(pair[0].fileno()), (b"halt",), None))
    assert halts.write() == ["other"]
    assert other[1].recv(100) == b"halt"
    halts.close()
    for sock in (*stuck, *other):
        sock.close()


def test_what_was_dropped_is_closed_and_not_written_any_more(device):
    _, ours = device
    halts = ProcessHalts()
    halts.store("rex", registered_halt(ours, (b"halt",), None))
    halts.drop("rex")
    halts.drop("nobody")
    assert (halts.write(), halts.robots) == ([], [])
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(ours)


def test_the_last_halt_of_a_robot_counts(device):
    robot, ours = device
    halts = ProcessHalts()
    halts.store("rex", registered_halt(os.dup(ours), (b"old",), None))
    halts.store("rex", registered_halt(ours, (b"new",), None))
    halts.write()
    assert os.read(robot, 100) == b"new"
    halts.close()


def test_no_halt_is_written_once_another_edge_may_have_the_robot():
    with socket.socket(type=socket.SOCK_DGRAM) as robot, socket.socket(type=socket.SOCK_DGRAM) as ours:
        robot.bind(("127.0.0.1", 0))
        robot.setblocking(False)
        halts = ProcessHalts()
        halts.store("rex", registered_halt(os.dup(ours.fileno()), (b"halt",), robot.getsockname()))
        halts.apply(WriteUntil(boot_time() - 0.001), [])
        assert halts.write() == []
        with pytest.raises(BlockingIOError):
            robot.recv(100)
        halts.close()


def test_halts_are_due_just_before_the_right_to_write_ends():
    halts = ProcessHalts()
    halts.store("rex", RegisteredHalt((b"halt",), lambda _frame: None, lambda: None))
    assert not halts.must_halt
    halts.apply(WriteUntil(boot_time() + 60.0), [])
    assert not halts.must_halt
    halts.apply(WriteUntil(boot_time() + HALT_MARGIN / 2), [])
    assert halts.must_halt
    halts.drop("rex")
    assert not halts.must_halt
