"""Samples of the bus: Cyberwave's header before a payload, and plain JSON without one."""

import contextlib
import struct

import pytest
from cyberwave.data.header import HeaderMeta, decode, encode
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import WireError
from fleet.wire.samples import (
    LARGEST_HEADER,
    array_parts,
    array_sample,
    json_payload,
    json_sample,
    stamp_of_header,
)

STAMPS = st.floats(allow_nan=False)
SEQUENCES = st.integers(-(2**63), 2**63 - 1)


def sample(header, payload=b"{}", *, stamp=5.0, length=None):
    """Return a sample with any header, and a length that may be wrong."""
    length = 16 + len(header) if length is None else length
    return struct.pack("<Idq", length, stamp, 0) + header + payload


def refused(read, data):
    with pytest.raises(WireError) as refusal:
        read(data)
    return refusal.value


@given(st.binary(max_size=40), STAMPS, SEQUENCES)
def test_a_payload_comes_back_from_behind_its_header(payload, stamp, sequence):
    made = json_sample(payload, stamp=stamp, sequence=sequence)
    assert (json_payload(made), stamp_of_header(made)) == (payload, stamp)
    header, theirs = decode(made)
    assert (header.content_type, header.ts, header.seq, theirs) == (
        "application/json",
        stamp,
        sequence,
        payload,
    )


@given(st.binary(max_size=40), STAMPS, SEQUENCES, st.sampled_from(["", "front"]))
def test_an_array_comes_back_with_its_shape_and_sensor(payload, stamp, sequence, sensor):
    made = array_sample(payload, stamp=stamp, sequence=sequence, shape=(2, 3), dtype="<f4", sensor=sensor)
    header, found_stamp, found = array_parts(made)
    assert (header["shape"], header["dtype"], header.get("sensor_id", "")) == ([2, 3], "<f4", sensor)
    assert (found_stamp, found, stamp_of_header(made)) == (stamp, payload, stamp)
    theirs, their_payload = decode(made)
    assert (theirs.shape, theirs.dtype, theirs.seq, their_payload) == ((2, 3), "<f4", sequence, payload)


def test_a_header_may_have_more_than_its_content_type():
    header = HeaderMeta("application/json", 7.0, 1, metadata={"sensor_id": "front"})
    assert json_payload(encode(header, b'{"a": 1}')) == b'{"a": 1}'


@pytest.mark.parametrize("payload", [b"{", b'{"ts": 1}', b"{" + b" " * 100])
def test_a_json_object_needs_no_header_and_has_no_stamp(payload):
    assert json_payload(payload) == payload
    assert stamp_of_header(payload) is None


@pytest.mark.parametrize("data", [b"", b"[]", b" {}", b"null", b"\x33\0\0\0", b"\xff" * 40])
def test_what_is_neither_is_refused(data):
    assert str(refused(json_payload, data)) == "neither a Cyberwave sample nor a JSON object"


@pytest.mark.parametrize(
    ("header", "where", "why"),
    [
        (b'{"content_type":"numpy/ndarray"}', "header.content_type", "'numpy/ndarray' is not JSON"),
        (b'{"content_type":"' + b"x" * 60 + b'"}', "header.content_type", "'" + "x" * 40 + "' is not JSON"),
        (b'{"content_type":7}', "header.content_type", "a string is needed, this is a number"),
        (b"{}", "header.content_type", "is missing"),
        (b"[]", "", "a JSON object is needed, this is an array"),
        (b"rubbish", "", "not JSON"),
        (b"", "", "not JSON"),
    ],
)
def test_a_header_of_something_else_is_refused_with_its_place(header, where, why):
    error = refused(json_payload, sample(header))
    assert error.where == where
    assert why in str(error)


def test_a_header_has_at_least_the_stamp_and_the_sequence_and_does_not_reach_beyond_the_sample():
    whole = sample(b'{"content_type":"application/json" }', b"")
    assert (json_payload(whole), stamp_of_header(whole)) == (b"", 5.0)
    for cut in (whole[:-1], whole[:19], sample(b"{}", length=15), sample(b"{}", b"", length=19)):
        assert stamp_of_header(cut) is None
    assert stamp_of_header(sample(b"", b"", length=16)) == 5.0


@pytest.mark.parametrize(("size", "read"), [(LARGEST_HEADER, True), (LARGEST_HEADER + 1, False)])
def test_a_header_of_more_than_64_kib_is_not_read(size, read):
    start, end = b'{"content_type":"application/json","x":"', b'"}'
    header = start + b"x" * (size - 16 - len(start) - len(end)) + end
    assert (stamp_of_header(sample(header)) is not None) is read
    if read:
        assert json_payload(sample(header)) == b"{}"
    else:
        refused(json_payload, sample(header))


@pytest.mark.parametrize("data", [b"", b'{"a": 1}', b"\0" * 40])
def test_an_array_needs_a_header(data):
    assert str(refused(array_parts, data)) == "an array with Cyberwave's header is needed"


def test_json_is_no_array():
    error = refused(array_parts, json_sample(b"{}", stamp=1.0, sequence=1))
    assert str(error) == "header.content_type: numpy/ndarray is needed"


@given(st.binary(max_size=60))
def test_arbitrary_bytes_raise_nothing_but_a_refusal(data):
    for read in (json_payload, stamp_of_header, array_parts):
        with contextlib.suppress(WireError):
            read(data)
