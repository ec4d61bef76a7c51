"""Names to addresses, without blocking the loop."""

import asyncio
import socket

import pytest

from fleet.errors import LinkLost
from fleet.link.resolve import addresses_of

V4, V6 = ("10.0.0.7", 14550), ("2001:db8::1", 14550, 0, 0)


@pytest.fixture
def names(monkeypatch):
    """Have the name server answer with this list, or fail with this error; return what it is asked."""

    def names(answer):
        asked = []

        async def getaddrinfo(host, port, **options):
            asked.append((host, port, options))
            if isinstance(answer, Exception):
                raise answer
            return answer

        monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", getaddrinfo)
        return asked

    return names


async def test_every_address_of_a_host_is_returned_the_best_first(names):
    asked = names(
        [
            (socket.AF_INET6, socket.SOCK_DGRAM, 17, "", V6),
            (socket.AF_INET, socket.SOCK_DGRAM, 17, "canonical", V4),
        ]
    )
    assert await addresses_of("udp:robot:14550", "robot", 14550, socket.SOCK_DGRAM) == [
        (socket.AF_INET6, 17, V6),
        (socket.AF_INET, 17, V4),
    ]
    assert asked == [("robot", 14550, {"type": socket.SOCK_DGRAM})]


@pytest.mark.parametrize(
    "error", [socket.gaierror(-2, "Name or service not known"), UnicodeError("label too long")]
)
async def test_a_name_without_an_address_is_lost_now_and_may_be_found_later(names, error):
    names(error)
    with pytest.raises(LinkLost) as caught:
        await addresses_of("tcp:robot:5760", "robot", 5760, socket.SOCK_STREAM)
    assert str(caught.value) == f"tcp:robot:5760: the name 'robot' has no address now ({error})"


async def test_any_other_error_is_not_hidden(names):
    names(PermissionError(1, "Operation not permitted"))
    with pytest.raises(PermissionError):
        await addresses_of("tcp:robot:5760", "robot", 5760, socket.SOCK_STREAM)
