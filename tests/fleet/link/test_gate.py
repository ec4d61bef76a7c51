"""The gate of links: nothing is written after its time, nor by a link of an earlier epoch."""

import pytest

from fleet.errors import LinkLost
from fleet.link.gate import GATE, LinkGate
from fleet.link.memory import MemoryRobot
from fleet.link.url import open_link


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def gate(clock):
    gate = LinkGate(clock)
    gate.epoch, gate.until = 7, 102.0
    token = GATE.set(gate)
    yield gate
    GATE.reset(token)


async def test_bytes_pass_until_the_gate_closes_and_none_after(gate, clock):
    with MemoryRobot("gated") as robot:
        link = await open_link("memory:gated", lambda _data, _address: None)
        link.send(b"1")
        clock.now = 101.99
        link.send(b"2")
        clock.now = 102.0
        with pytest.raises(LinkLost, match="the lease of this edge has ended"):
            link.send(b"3")
        assert robot.heard == [b"1", b"2"]
        await link.close()


async def test_a_link_of_an_earlier_epoch_stays_closed(gate, clock):
    with MemoryRobot("gated") as robot:
        link = await open_link("memory:gated", lambda _data, _address: None)
        clock.now, gate.epoch, gate.until = 110.0, 8, 112.0
        with pytest.raises(LinkLost):
            link.send(b"1")
        assert robot.heard == []
        await link.close()


async def test_no_link_is_opened_without_the_lease(gate, clock):
    clock.now = 103.0
    with MemoryRobot("gated") as robot:
        with pytest.raises(LinkLost):
            await open_link("memory:gated", lambda _data, _address: None)
        assert robot.opened == 0


async def test_an_edge_without_a_pair_has_no_gate():
    with MemoryRobot("free") as robot:
        link = await open_link("memory:free", lambda _data, _address: None)
        link.send(b"1")
        assert robot.heard == [b"1"]
        await link.close()


async def test_what_only_some_links_have_is_still_there(gate):
    with MemoryRobot("gated"):
        link = await open_link("memory:gated", lambda _data, _address: None)
        assert (link.fileno(), link.url) == (-1, "memory:gated")
        with pytest.raises(AttributeError):
            link.unsent()
        await link.close()
        with pytest.raises(LinkLost):
            await link.lost()
