"""A simulated board behind a device file: bytes both ways, and a cable that is pulled and put back."""

import asyncio
import contextlib
import os

import pytest

from fleet_ugv.sim.board import SimBoard
from fleet_ugv.sim.physics import BaseBody
from fleet_ugv.sim.port import SimPort


class Parrot(SimBoard):
    """A board that answers in capital letters, and says ``news`` in each step."""

    news = b""

    def handle_bytes(self, data, now):
        return data.upper()

    def speak(self, now):
        return self.news

    def restart(self, now):
        self.news = b""


@pytest.fixture
async def port(tmp_path):
    board = Parrot(BaseBody(track=0.2), timeout=1.0, voltage=12.0)
    port = SimPort(board, tmp_path / "beast", 115200)
    yield port
    port.close()


@pytest.fixture
def client(port):
    """Return a program's end of the line."""
    descriptor = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    yield descriptor
    os.close(descriptor)


def is_there(port):
    return os.path.lexists(port.path)


async def received(descriptor, ending, meanwhile=lambda: None):
    """Read until ``ending`` has come: the kernel passes bytes through a terminal in its own time.

    ``meanwhile`` is called after each read.
    """
    loop, data, readable = asyncio.get_running_loop(), b"", asyncio.Event()
    loop.add_reader(descriptor, readable.set)
    try:
        async with asyncio.timeout(10):
            while not data.endswith(ending):
                await readable.wait()
                readable.clear()
                with contextlib.suppress(BlockingIOError):
                    data += os.read(descriptor, 4096)
                meanwhile()
    finally:
        loop.remove_reader(descriptor)
    return data


async def test_a_link_to_it_has_its_baud_rate(port, tmp_path):
    assert port.url == f"serial:{tmp_path}/beast?baud=115200"


async def test_what_is_written_is_answered_by_the_board(port, client):
    os.write(client, b"go\r")
    assert await received(client, b"\r") == b"GO\r"


async def test_what_the_board_says_by_itself_comes_with_its_steps(port, client):
    port.step()  # without news
    port.board.news = b"\x00\r\n\x03\xff"  # as it is: the line is raw
    port.step()
    assert await received(client, b"\xff") == b"\x00\r\n\x03\xff"


async def test_a_program_that_leaves_and_comes_back_finds_it_again(port):
    for _ in range(2):
        descriptor = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        port.board.news = b"hello"
        port.step()
        assert await received(descriptor, b"o") == b"hello"
        os.close(descriptor)


async def test_what_nobody_reads_is_lost_and_stops_nothing(port, client):
    port.board.news = b"x" * 4096
    for _ in range(50):
        port.step()
    port.board.news = b"new"
    data = await received(client, b"new", meanwhile=port.step)  # a step says nothing while the line is full
    assert 0 < data.count(b"x") < 50 * 4096


async def test_without_its_cable_there_is_no_device_and_the_board_lives_on(port, client):
    port.unplug()
    assert (port.plugged, is_there(port)) == (False, False)
    with pytest.raises(OSError):
        os.write(client, b"go")
    port.board.news = b"news"
    port.step()
    port.unplug()  # it is out already
    port.plug()
    assert is_there(port)


async def test_a_cable_comes_back_after_its_time(port, monkeypatch):
    now = 10.0
    monkeypatch.setattr(port, "now", lambda: now)
    port.fault("unplug", 2.0)
    now = 11.9
    port.step()
    assert not port.plugged
    now = 12.0
    port.step()
    assert port.plugged
    port.board.news = b"back"
    descriptor = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    port.step()
    assert await received(descriptor, b"k") == b"back"
    os.close(descriptor)


async def test_other_faults_are_those_of_the_board(port):
    port.fault("slip", 0.5)
    assert port.board.physics.slip == 0.5
    port.fault("slip", None)
    port.fault("unplug", None)
    assert (port.board.physics.slip, port.plugged) == (0.0, True)
    with pytest.raises(ValueError, match="there is no fault 'slop'"):
        port.fault("slop", 1.0)


async def test_the_truth_of_its_base_is_looked_at(port):
    physics = port.board.physics
    physics.x, physics.y, physics.yaw, physics.speeds = 1.0, -2.0, 0.5, [0.1, 0.2]
    assert port.true_state() == {"x": 1.0, "y": -2.0, "yaw": 0.5, "left": 0.1, "right": 0.2}


async def test_a_closed_port_leaves_nothing(port):
    descriptors = (port._master, port._device)
    port.close()
    assert not is_there(port)
    for descriptor in descriptors:
        with pytest.raises(OSError):
            os.fstat(descriptor)
