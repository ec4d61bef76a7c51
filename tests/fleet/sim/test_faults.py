"""Faults by name, and the wire that carries them out."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.sim.faults import WIRE_FAULTS, BadWire, parse_faults

FRAMES = [bytes([number]) * 4 for number in range(200)]


def carried(faults, *, seconds=10.0):
    wire = BadWire(faults, Random(1))
    arrived = []
    for number, frame in enumerate(FRAMES):
        arrived += wire.carry([frame], number * 0.01)
    return arrived + wire.carry((), seconds)


def test_a_good_wire_changes_nothing():
    assert carried({}) == FRAMES


def test_faults_are_written_with_and_without_a_number():
    assert parse_faults("loss:0.05, silent", WIRE_FAULTS) == {"loss": 0.05, "silent": 1.0}
    assert parse_faults("", WIRE_FAULTS) == {}


@pytest.mark.parametrize("text", ["loss:2", "loss:-1", "loss:x", "lost:1", "delay:nan", "delay:inf"])
def test_nonsense_is_refused(text):
    with pytest.raises(ValueError, match="fault"):
        parse_faults(text, WIRE_FAULTS)


def test_loss_takes_its_share():
    assert 120 < len(carried({"loss": 0.25})) < 175


def test_silence_takes_all():
    assert carried({"silent": 1.0}) == []


def test_delay_is_late_and_keeps_the_order():
    wire = BadWire({"delay": 0.2}, Random(1))
    assert wire.carry([b"a", b"b"], 0.0) == []
    assert wire.carry((), 0.19) == []
    assert wire.carry((), 0.2) == [b"a", b"b"]


def test_duplicates_come_twice():
    arrived = carried({"duplicate": 1.0})
    assert sorted(arrived) == sorted(FRAMES * 2)


def test_reordering_loses_nothing():
    arrived = carried({"reorder": 0.3})
    assert arrived != FRAMES
    assert sorted(arrived) == sorted(FRAMES)


def test_corruption_spoils_one_byte():
    arrived = carried({"corrupt": 1.0})
    assert all(
        sum(a != b for a, b in zip(got, sent, strict=True)) == 1
        for got, sent in zip(arrived, FRAMES, strict=True)
    )


def test_a_fault_that_ends_lets_what_is_under_way_arrive():
    faults = {"delay": 0.5}
    wire = BadWire(faults, Random(1))
    wire.carry([b"a"], 0.0)
    faults.clear()
    assert wire.carry([b"b"], 0.1) == [b"b"]
    assert wire.carry((), 0.6) == [b"a"]


@given(st.text())
def test_any_text_is_faults_or_a_value_error(text):
    try:
        found = parse_faults(text, WIRE_FAULTS)
    except ValueError:
        return
    assert set(found) <= set(WIRE_FAULTS)
