"""Links of a recording: an adapter opens them like any other, and gets what was received then."""

import asyncio

import pytest

from fleet.errors import LinkLost
from fleet.link.tap import LinkFrame
from fleet.replay.recorded_links import RecordedLinks

URL = "tcp://10.0.0.7:5760"


def came(data=b"x", peer=""):
    return LinkFrame(1.0, "in", data, peer)


OPENED = LinkFrame(2.0, "open")


@pytest.fixture
async def links():
    return RecordedLinks((URL, "udp://:14550"))


@pytest.fixture
async def opened(links):
    """Open a link; give it, and what is received of it."""
    received = []
    link = await links.open(URL, lambda data, address: received.append((data, address)))
    return link, received


async def fallen(link):
    with pytest.raises(LinkLost) as error:
        await asyncio.wait_for(link.lost(), 20)
    return str(error.value)


async def test_a_frame_is_received_as_it_came(links, opened):
    link, received = opened
    links.deliver(URL, came(b"one"))
    links.deliver(URL, came(b"two"))
    assert received == [(b"one", None), (b"two", None)]
    assert (link.url, link.stats.received, link.fileno()) == (URL, 2, -1)


@pytest.mark.parametrize(
    ("peer", "address"),
    [
        ("10.0.0.7:14550", ("10.0.0.7", 14550)),
        ("fe80::1:9", ("fe80::1", 9)),
        ("", None),
        ("10.0.0.7", None),
        (":14550", None),
        ("rex:tty", None),
    ],
)
async def test_a_datagram_comes_with_the_address_of_its_peer(links, opened, peer, address):
    links.deliver(URL, came(peer=peer))
    assert opened[1] == [(b"x", address)]


async def test_what_is_sent_is_counted_and_goes_nowhere(opened):
    link, received = opened
    assert link.send(b"GO")
    assert link.send(b"GO", ("10.0.0.7", 9))
    assert (link.stats.sent, received) == (2, [])


async def test_what_was_sent_then_is_not_received_now(links, opened):
    links.deliver(URL, LinkFrame(1.0, "out", b"GO"))
    assert opened[1] == []


async def test_a_link_without_frames_is_not_there(links):
    with pytest.raises(LinkLost, match="serial:ttyS0: the recording has no frames of it"):
        await links.open("serial:ttyS0", print)


async def test_frames_of_a_link_that_is_not_open_are_passed_over(links, opened):
    links.deliver("udp://:14550", came())
    links.deliver("udp://:14550", OPENED)
    links.deliver("unknown", came())
    assert opened[1] == []


async def test_a_link_that_was_opened_again_then_ends_and_may_be_opened_again(links, opened):
    link, received = opened
    links.deliver(URL, OPENED)
    assert link.send(b"GO"), "it has just been opened"
    links.deliver(URL, came())
    links.deliver(URL, OPENED)
    assert await fallen(link) == f"{URL}: it was opened again then"
    with pytest.raises(LinkLost):
        link.send(b"GO")
    links.deliver(URL, came(b"between"))
    assert received == [(b"x", None)]
    again = []
    await links.open(URL, lambda data, _address: again.append(data))
    links.deliver(URL, came(b"two"))
    assert (again, received) == ([b"two"], [(b"x", None)])


async def test_nothing_is_received_of_a_closed_link_and_its_first_end_stays(links, opened):
    link, received = opened
    await link.close()
    links.deliver(URL, came())
    link.fall("later")
    assert received == []
    assert await fallen(link) == f"{URL}: closed"
