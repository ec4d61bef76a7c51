import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.model.summary import LARGEST, LISTED, NAMED, Summary, Trouble, decode, encode

words = st.sampled_from(["degraded", "offline", "fault"])
texts = st.text(max_size=63)
troubles = st.builds(
    Trouble,
    level=words,
    cause=st.text(max_size=160),
    since=st.floats(0, 2e9),
    robots=st.integers(0, 9999),
    kind=texts,
    link=st.text(max_size=80),
    names=st.lists(texts, max_size=NAMED).map(tuple),
)
summaries = st.builds(
    Summary,
    edge=st.just("yard-1"),
    version=st.text(max_size=12),
    stamp=st.floats(0, 2e9),
    uptime=st.floats(0, 1e9),
    site=st.just("north"),
    robots=st.dictionaries(words, st.integers(0, 9999)),
    troubles=st.lists(troubles, max_size=LISTED).map(tuple),
    more=st.integers(0, 99),
)


@given(summaries)
def test_a_summary_fits_and_no_cause_of_it_is_lost_in_silence(summary):
    encoded = encode(summary)
    assert len(encoded) <= LARGEST
    read = decode(encoded, "yard-1")
    assert len(read.troubles) + read.more == len(summary.troubles) + summary.more
    assert set(read.troubles) <= set(summary.troubles)


def test_what_finds_no_room_is_what_matters_least():
    kept = Trouble("fault", "x" * 160, 5.0, robots=1)
    lesser = [Trouble("degraded", "ü" * 160, 1.0, robots=number) for number in (7, 8, 9)]
    read = decode(encode(Summary("yard-1", "1", 9.0, 1.0, troubles=(*lesser, kept))), "yard-1")
    assert kept in read.troubles
    assert lesser[0] not in read.troubles
    assert read.more


GOOD = {"edge": "yard-1", "version": "1", "stamp": 1.0, "uptime": 1.0}
TROUBLE = {"level": "fault", "cause": "why", "since": 1.0}


@pytest.mark.parametrize(
    "wrong",
    [
        {"edge": "barn"},
        {"edge": "../x"},
        {"stamp": "1"},
        {"stamp": -1},
        {"uptime": None},
        {"health": "splendid"},
        {"robots": {"splendid": 1}},
        {"robots": {"ok": -1}},
        {"robots": {"ok": 1e9}},
        {"version": "x" * 64},
        {"troubles": [TROUBLE] * (LISTED + 1)},
        {"troubles": [TROUBLE | {"names": ["a"] * (NAMED + 1)}]},
        {"troubles": [TROUBLE | {"cause": "x" * 161}]},
        {"troubles": [TROUBLE | {"since": 1e300}]},
    ],
)
def test_what_is_no_summary_of_the_edge_is_refused(wrong):
    assert decode(msgspec.json.encode(GOOD), "yard-1").health == "ok"
    with pytest.raises(WireError, match="a summary"):
        decode(msgspec.json.encode(GOOD | wrong), "yard-1")


@pytest.mark.parametrize("payload", [b"", b"{}", b"[]", b"\xff", b'{"edge": NaN}'])
def test_garbage_is_refused(payload):
    with pytest.raises(WireError, match="cannot be read"):
        decode(payload, "yard-1")


def test_a_summary_that_is_too_large_is_not_even_read():
    with pytest.raises(WireError, match="1025 bytes; 1024 are the most"):
        decode(b" " * 1025, "yard-1")


def test_a_field_that_a_newer_fleet_adds_is_passed_over():
    assert decode(msgspec.json.encode(GOOD | {"mood": "fine"}), "yard-1").edge == "yard-1"
