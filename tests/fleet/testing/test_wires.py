import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import LinkLost
from fleet.link.memory import MemoryRobot
from fleet.link.url import open_link
from fleet.testing.wires import Corrupt, Datagrams, Delayed, Lossy, OneByteAtATime, Reordered, WornLink, over

PIECES = [b"%d" % number for number in range(100)]


def carried(wire, pieces=PIECES):
    return [piece for data in pieces for piece in wire.carry(data)] + wire.rest()


@given(st.lists(st.binary()))
def test_single_bytes_are_the_same_stream(pieces):
    arrived = carried(OneByteAtATime(), pieces)
    assert b"".join(arrived) == b"".join(pieces)
    assert all(len(piece) == 1 for piece in arrived)


def test_a_lossy_wire_loses_about_its_rate_and_reorders_nothing():
    arrived = carried(Lossy(seed=1, rate=0.3))
    assert 50 <= len(arrived) <= 90
    assert arrived == sorted(arrived, key=int)


def test_a_corrupt_wire_turns_single_bits():
    arrived = carried(Corrupt(seed=1, rate=1.0), [b"\x00" * 8] * 50)
    assert all(int.from_bytes(piece, "big").bit_count() == 1 for piece in arrived)


def test_a_delayed_wire_keeps_a_few_under_way():
    wire = Delayed(pieces=2)
    assert [wire.carry(piece) for piece in PIECES[:4]] == [[], [], [b"0"], [b"1"]]
    assert wire.rest() == [b"2", b"3"]


def test_a_reordering_wire_loses_nothing():
    arrived = carried(Reordered(seed=1, window=4))
    assert arrived != PIECES
    assert sorted(arrived) == sorted(PIECES)


@pytest.mark.parametrize("make", [Lossy, Corrupt, Reordered])
def test_the_same_seed_gives_the_same_faults(make):
    assert carried(make(7)) == carried(make(7)) != carried(make(8))


def test_a_receiver_hears_through_a_wire():
    heard = []
    over(OneByteAtATime(), lambda data, address: heard.append((data, address)))(b"ab", "there")
    assert heard == [(b"a", "there"), (b"b", "there")]


async def test_a_worn_link_sends_through_a_wire():
    with MemoryRobot("worn") as robot:
        link = WornLink(await open_link("memory:worn", lambda data, address: None), Delayed(1))
        for piece in PIECES[:3]:
            link.send(piece)
        assert robot.heard == PIECES[:2]
        await link.close()
        with pytest.raises(LinkLost):
            await link.lost()


def test_a_good_wire_changes_nothing():
    assert carried(Datagrams()) == PIECES
