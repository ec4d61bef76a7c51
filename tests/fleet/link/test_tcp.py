import contextlib
import socket
import threading

import pytest

from fleet.errors import LinkLost
from fleet.link.url import open_link


@pytest.fixture
async def connected(receiver):
    """Give a link, the robot's socket, and what the link hears."""
    heard = receiver()
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = await open_link(f"tcp:127.0.0.1:{server.getsockname()[1]}", heard)
        robot, _ = server.accept()
    yield link, robot, heard
    robot.close()
    await link.close()


def flood(link):
    for _ in range(100_000):
        link.send(b"M 0.5 0.0\n" * 100)


async def fill_the_queue(url, heard, opened):
    """Open links that the listener never accepts; the kernel takes a few."""
    for _ in range(10):
        link = await open_link(url, heard)
        opened.push_async_callback(link.close)


async def test_bytes_go_both_ways(connected):
    link, robot, heard = connected
    link.send(b"ping")
    assert robot.recv(100) == b"ping"
    robot.sendall(b"pong")
    await heard.until(b"pong")


async def test_small_writes_are_not_held_back(connected):
    with socket.socket(fileno=socket.dup(connected[0]._descriptor)) as same:
        assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


async def test_a_robot_that_closes_is_noticed(connected, loss_reason):
    link, robot, _ = connected
    robot.close()
    assert "the other side closed it" in await loss_reason(link)
    with pytest.raises(LinkLost, match="closed"):
        link.send(b"x")


async def test_a_robot_that_does_not_read_costs_the_link_not_the_loop(connected, loss_reason):
    link, _, _ = connected
    with pytest.raises(LinkLost, match="does not read"):
        flood(link)
    assert "does not read" in await loss_reason(link)
    assert link.stats.dropped == 1


async def test_a_stop_goes_out_from_another_thread_while_the_loop_is_stuck(connected):
    link, robot, _ = connected
    thread = threading.Thread(target=link.send, args=(b"stop",))
    thread.start()
    thread.join()
    assert robot.recv(100) == b"stop"


async def test_what_was_written_before_closing_arrives(connected):
    link, robot, _ = connected
    link.send(b"M 0 0\n")
    await link.close()
    await link.close()
    assert robot.recv(100) == b"M 0 0\n"
    assert robot.recv(100) == b""


async def test_a_port_without_a_listener_may_work_later(receiver):
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
        with pytest.raises(LinkLost, match="Connection refused"):
            await open_link(f"tcp:127.0.0.1:{port}", receiver())


async def test_a_host_that_never_answers_is_given_up(receiver, monkeypatch):
    monkeypatch.setattr("fleet.link.tcp.CONNECT_TIMEOUT", 0.05)
    with socket.create_server(("127.0.0.1", 0), backlog=0) as full:
        url = f"tcp:127.0.0.1:{full.getsockname()[1]}"
        async with contextlib.AsyncExitStack() as opened:
            with pytest.raises(LinkLost, match=r"no answer in 0\.05 s"):
                await fill_the_queue(url, receiver(), opened)
