"""Entries of the store: what cannot be read is refused in one line."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import StateError
from fleet.rollout.messages import LARGEST, Desired, Observed, Stage, read_entry


@pytest.mark.parametrize("entry", [Desired("r1", "b1", 2), Observed("yard-1", "r1", "b1", Stage.DONE)])
def test_what_was_written_is_read(entry):
    assert read_entry(msgspec.json.encode(entry), type(entry), "here") == entry


def test_a_newer_format_and_a_large_entry_are_refused_with_the_place():
    with pytest.raises(StateError, match=r"here has format 2; this fleet reads 1: update it"):
        read_entry(b'{"format": 2}', Desired, "here")
    with pytest.raises(StateError, match="here has more than 1 MiB"):
        read_entry(b" " * (LARGEST + 1), Desired, "here")


@given(st.binary(max_size=100))
def test_any_other_bytes_are_refused(data):
    with pytest.raises(StateError, match="here cannot be read"):
        read_entry(data, Desired, "here")
