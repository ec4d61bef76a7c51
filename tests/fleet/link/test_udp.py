import asyncio
import socket
import threading

import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet.link.url import open_link


@pytest.fixture
async def pair(receiver):
    """Give a listening link and one that speaks to it."""
    heard, answered = receiver(), receiver()
    listening = await open_link("udpin:127.0.0.1:0", heard)
    speaking = await open_link(listening.url.replace("udpin", "udpout"), answered)
    yield listening, speaking, heard, answered
    await speaking.close()
    await listening.close()


async def test_a_listener_answers_whom_it_heard_last(pair):
    listening, speaking, heard, answered = pair
    speaking.send(b"hello")
    await heard.until(b"hello")
    listening.send(b"there")
    await answered.until(b"there")


async def test_a_listener_answers_each_sender_by_its_address(receiver, pair):
    listening, speaking, heard, answered = pair
    late = receiver()
    other = await open_link(listening.url.replace("udpin", "udpout"), late)
    speaking.send(b"a")
    await heard.until(b"a")
    other.send(b"b")
    await heard.until(b"ab")
    listening.send(b"first", heard.addresses[0])
    listening.send(b"second", heard.addresses[1])
    await answered.until(b"first")
    await late.until(b"second")
    await other.close()


async def test_what_is_sent_before_anyone_was_heard_is_counted_as_dropped(receiver):
    link = await open_link("udpin:127.0.0.1:0", receiver())
    assert not link.send(b"who is there")
    assert (link.stats.sent, link.stats.dropped) == (0, 1)
    await link.close()


async def test_a_taken_port_is_refused_with_what_to_do(pair, receiver):
    with pytest.raises(LinkRefused, match="the port is taken; stop the program"):
        await open_link(pair[0].url, receiver())


async def test_a_foreign_address_is_refused(receiver):
    with pytest.raises(LinkRefused, match="no such address"):
        await open_link("udpin:192.0.2.1:14550", receiver())


async def test_a_peer_that_is_not_there_yet_is_heard_once_it_is(receiver):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as reserved:
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
    link = await open_link(f"udpout:127.0.0.1:{port}", receiver())
    for _ in range(3):
        link.send(b"nobody")
    heard = receiver()
    robot = await open_link(f"udpin:127.0.0.1:{port}", heard)
    link.send(b"now")
    await heard.until(b"now")
    await robot.close()
    await link.close()


async def test_a_peer_that_was_not_there_for_a_while_is_heard_again(receiver, free_udp_port):
    """An event loop of libuv stops watching a socket that had an ICMP error."""
    answered = receiver()
    speaking = await open_link(f"udpout:127.0.0.1:{free_udp_port}", answered)
    for _ in range(5):
        speaking.send(b"is anybody there?")
        await asyncio.sleep(0.01)
    heard = receiver()
    listening = await open_link(f"udpin:127.0.0.1:{free_udp_port}", heard)
    speaking.send(b"hello")
    await heard.until(b"hello")
    listening.send(b"there")
    await answered.until(b"there")
    await speaking.close()
    await listening.close()


async def test_a_stop_goes_out_from_another_thread_while_the_loop_is_stuck(pair):
    listening, speaking, heard, answered = pair
    speaking.send(b"hello")
    await heard.until(b"hello")
    thread = threading.Thread(target=listening.send, args=(b"stop",))
    thread.start()
    thread.join()  # the loop stands still meanwhile
    await answered.until(b"stop")


async def test_a_closed_link_sends_and_receives_nothing(pair, receiver, loss_reason):
    listening, speaking, heard, _ = pair
    await listening.close()
    speaking.send(b"too late")
    with pytest.raises(LinkLost, match="closed"):
        listening.send(b"x")
    assert "closed" in await loss_reason(listening)
    assert heard.pieces == []


async def test_a_flood_does_not_hold_the_loop(pair):
    _, speaking, heard, _ = pair
    for _ in range(200):
        speaking.send(b"x")
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert len(heard.pieces) < 200
    await heard.until(b"x" * 200)


async def test_a_name_without_an_address_may_work_later(receiver):
    with pytest.raises(LinkLost, match="no address now"):
        await open_link("udpout:robot.invalid:14550", receiver())
