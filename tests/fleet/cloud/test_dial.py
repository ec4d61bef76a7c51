"""Opening a TCP connection through networks that swallow what is sent."""

import asyncio
import contextlib
import socket

import pytest

from fleet.cloud.dial import dial

SOON = 0.02  # s between tries
WITHIN = 60.0  # s


@pytest.fixture
def door():
    """Listen on loopback."""
    with socket.create_server(("127.0.0.1", 0)) as door:
        yield door


@pytest.fixture
def swallowing():
    """Listen where the kernel drops who knocks, as there is no room: gives the socket and who fills it."""
    with contextlib.ExitStack() as stack:
        door = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        yield door, stack.enter_context(socket.create_connection(door.getsockname()))


@pytest.fixture
def tried(monkeypatch):
    """Return the sockets that are being connected, in order."""
    seen, connect = [], socket.socket.connect_ex

    def connect_ex(opened, address):
        seen.append(opened)
        return connect(opened, address)

    monkeypatch.setattr(socket.socket, "connect_ex", connect_ex)
    return seen


@pytest.fixture
def known_as(monkeypatch):
    """Say which addresses every name has: ``known_as((host, port), ...)``."""

    def known_as(*addresses):
        async def getaddrinfo(*_, **__):
            return [(socket.AF_INET, socket.SOCK_STREAM, 0, "", address) for address in addresses]

        monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", getaddrinfo)

    return known_as


async def test_a_network_that_is_back_is_found_by_a_later_try(swallowing, tried):
    door, _ = swallowing
    dialled = asyncio.create_task(dial(*door.getsockname(), again=SOON))
    async with asyncio.timeout(WITHIN):
        while len(tried) < 3:  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(SOON)
        door.accept()[0].close()
        opened = await dialled
    assert opened is not tried[0], "the first is repeated by the kernel after a whole second"
    await asyncio.sleep(0)
    assert [each for each in tried if each.fileno() != -1] == [opened]
    opened.close()


async def test_an_address_that_swallows_does_not_keep_us_from_the_next(swallowing, door, known_as):
    known_as(swallowing[0].getsockname(), door.getsockname())
    with await dial("broker", 1, again=SOON) as opened:
        assert opened.getpeername() == door.getsockname()


async def test_an_address_that_refuses_gives_way_to_the_next_at_once(door, known_as):
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        refusing = nobody.getsockname()
    known_as(refusing, door.getsockname())
    with await dial("broker", 1, again=WITHIN) as opened:
        assert opened.getpeername() == door.getsockname()


async def test_nobody_at_any_address_is_an_error(door, known_as):
    known_as(door.getsockname(), door.getsockname())
    door.close()
    with pytest.raises(ConnectionRefusedError):
        await dial("broker", 1)


async def test_a_name_without_an_address_is_an_error(known_as):
    known_as()
    with pytest.raises(OSError, match="broker has no address"):
        await dial("broker", 1)


async def test_who_is_given_up_leaves_nothing_open(swallowing, tried):
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(dial(*swallowing[0].getsockname(), again=SOON), 5 * SOON)
    await asyncio.sleep(0)
    assert {each.fileno() for each in tried} == {-1}
