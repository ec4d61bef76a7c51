import asyncio
import fcntl
import struct
import threading

import pytest

from fleet.cloud.broker_socket import UNSENT, BrokerSocket

SIOCOUTQNSD = 0x894B  # how many bytes of a socket the network has not been given yet
WITHIN = 60.0  # s
LARGE = bytes(range(256)) * 65_536  # more than any socket takes at once


@pytest.fixture
async def stream(ends):
    def room():
        stream.write_rest()

    stream = BrokerSocket(ends[0], lambda: None, room)
    yield stream
    stream.close()


def received(end, size):
    data = bytearray()
    while len(data) < size:
        data += end.recv(1 << 20)
    return bytes(data)


@pytest.mark.parametrize("aside", [False, True])
async def test_what_has_no_room_is_written_when_there_is_whoever_wrote_it(stream, ends, monkeypatch, aside):
    loop, threads = asyncio.get_running_loop(), []
    add = loop.add_writer

    def add_writer(*arguments):
        threads.append(threading.current_thread())
        add(*arguments)

    monkeypatch.setattr(loop, "add_writer", add_writer)
    await asyncio.to_thread(stream.write, LARGE) if aside else stream.write(LARGE)
    assert stream.full
    stream.write(b"more")
    got = await asyncio.wait_for(asyncio.to_thread(received, ends[1], len(LARGE) + 4), WITHIN)
    assert got == LARGE + b"more"
    assert not stream.full
    assert threads == [threading.current_thread()]


async def test_what_has_no_room_when_it_is_closed_is_lost(stream, ends):
    await asyncio.to_thread(stream.write, LARGE)
    stream.close()
    assert not stream.full
    assert len(received(ends[1], 1)) < len(LARGE)


async def test_little_waits_in_the_kernel_for_a_slow_network_to_go_stale_there(stream, ends):
    stream.write(LARGE)
    unsent = struct.unpack("i", fcntl.ioctl(ends[0], SIOCOUTQNSD, b"\0" * 4))[0]
    assert 0 < unsent < 4 * UNSENT
