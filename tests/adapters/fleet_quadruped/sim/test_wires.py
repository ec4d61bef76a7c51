"""Bad wires of a simulated robot: what becomes of its frames, in each direction and on each bus by itself."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet import CanFrame
from fleet_quadruped.sim.wires import BadBuses

FRAME = CanFrame(0x201, b"\x0f\x00")


def wires(**faults):
    buses = BadBuses(["a", "b"], 1)
    buses.faults.update(faults)
    return buses


def test_without_faults_frames_are_passed_on_as_they_are():
    buses, frames = wires(), [FRAME, CanFrame(0x202, b"")]
    assert buses.to_dog("a", frames, 0.0) is frames
    assert buses.from_dog("b", frames, 0.0) is frames


@settings(max_examples=20)
@given(
    st.integers(0, 0x1FFFFFFF),
    st.binary(max_size=64),
    st.booleans(),
    st.booleans(),
    st.sampled_from(["to", "from"]),
)
def test_a_frame_arrives_as_it_was_sent(identifier, data, fd, remote, way):
    frame = CanFrame(identifier, data, fd, remote)
    buses = wires(delay=0.0)
    carry = buses.to_dog if way == "to" else buses.from_dog
    assert carry("a", [frame], 0.0) == [frame]


def test_a_delayed_frame_comes_on_its_own_bus_in_its_own_direction():
    buses = wires(delay=0.1)
    assert buses.to_dog("a", [FRAME], 0.0) == []
    assert buses.to_dog("b", (), 0.2) == []
    assert buses.from_dog("a", (), 0.2) == []
    assert buses.to_dog("a", (), 0.2) == [FRAME]


@pytest.mark.parametrize(("fault", "count"), [("loss", 0), ("silent", 0), ("duplicate", 2)])
def test_a_frame_is_lost_or_comes_twice(fault, count):
    assert wires(**{fault: 1.0}).from_dog("a", [FRAME], 0.0) == [FRAME] * count


def test_the_seed_decides_which_frames_are_lost():
    def arrived(seed):
        buses = BadBuses(["a"], seed)
        buses.faults["loss"] = 0.5
        return [len(buses.to_dog("a", [FRAME], now)) for now in range(40)]

    assert arrived(3) == arrived(3)
    assert arrived(3) != arrived(4)
    assert 5 < sum(arrived(3)) < 35


def test_a_fault_may_begin_and_end_at_any_time():
    buses = wires()
    buses.faults["silent"] = 1.0
    assert buses.to_dog("a", [FRAME], 0.0) == []
    buses.faults.clear()
    assert buses.to_dog("a", [FRAME], 0.1) == [FRAME]
