"""Entries of the store: an unreadable one is refused in one line."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import StateError
from fleet.rollout.messages import LARGEST, BundleStage, DesiredState, ObservedState, read_entry

ADDRESS = "a" * 64


@pytest.mark.parametrize(
    "entry", [DesiredState("r1", ADDRESS, 2), ObservedState("yard-1", "r1", ADDRESS, BundleStage.DONE)]
)
def test_an_entry_is_read_as_it_was_written(entry):
    assert read_entry(msgspec.json.encode(entry), type(entry), "here") == entry


def test_a_newer_format_and_a_large_entry_are_refused_with_the_place():
    with pytest.raises(StateError, match=r"here has format 2; this fleet reads 1: update it"):
        read_entry(b'{"format": 2}', DesiredState, "here")
    with pytest.raises(StateError, match="here has more than 1 MiB"):
        read_entry(b" " * (LARGEST + 1), DesiredState, "here")


@pytest.mark.parametrize(
    "wrong",
    [
        DesiredState("r" * 65, ADDRESS, 1),
        DesiredState("r1", "../../etc", 1),
        DesiredState("r1", ADDRESS, 0),
        DesiredState("r1", ADDRESS, 1, settle=1e9),
        DesiredState("r1", ADDRESS, 1, by="b" * 257),
        ObservedState("yard-1", "r1", ADDRESS, BundleStage.DONE, why="w" * 501),
        ObservedState("yard-1", "r1", ADDRESS, BundleStage.DONE, lines=("line",) * 51),
        ObservedState("yard-1", "r1", ADDRESS, BundleStage.DONE, lines=("l" * 201,)),
    ],
)
def test_a_value_beyond_its_limit_is_refused(wrong):
    with pytest.raises(StateError, match="here cannot be read"):
        read_entry(msgspec.json.encode(wrong), type(wrong), "here")


@given(st.binary(max_size=100))
def test_arbitrary_bytes_are_refused(data):
    with pytest.raises(StateError, match="here cannot be read"):
        read_entry(data, DesiredState, "here")
