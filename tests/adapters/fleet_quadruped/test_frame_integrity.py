"""Counters and checksums of a maker's own frames."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fleet_quadruped.frame_integrity import Checksum, Counter, FrameIntegrity, ProtectedFrame
from fleet_quadruped.frames import FrameDecoder, FrameMap, encode
from fleet_quadruped.selfwalk.by_frames import FixedFrame

X = {"x": {"at": 0, "type": "i16", "endian": "big", "scale": 0.001}}


def test_a_padded_frame_has_its_whole_length_and_its_constants():
    frame = FrameMap.model_validate({"id": 0x111, "fields": X, "dlc": 8, "data": "00000000A5"})
    assert encode(frame, {"x": 0.5}) == bytes.fromhex("01F40000A5000000")
    assert FrameDecoder([frame]).decode(0x111, bytes.fromhex("01F4")) is None


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"dlc": 1}, "dlc: 1 bytes, and 2 are in it"),
        ({"data": "0001"}, "byte 1 is 01h in data, and 'x' is there"),
        ({"counter": {"at": 1}}, "byte 1 is in both 'counter' and 'x'"),
        ({"counter": {"at": 6}, "checksum": {"at": 6}}, "counter and checksum are in the same byte"),
        ({"dlc": 6, "checksum": {"at": 7}}, "dlc: 6 bytes, and 8 are in it"),
    ],
)
def test_what_does_not_fit_is_refused(changes, why):
    with pytest.raises(ValidationError, match=why):
        FrameMap.model_validate({"id": 0x111, "fields": X} | changes)


def test_a_fixed_frame_leaves_room_for_its_seal():
    with pytest.raises(ValidationError, match="byte 7 of data must be 00: its checksum is there"):
        FixedFrame.model_validate({"id": 0x131, "data": "01", "checksum": {"at": 7}})


def test_a_counter_goes_on_and_wraps_in_its_own_bits():
    integrity = FrameIntegrity(0x111, ProtectedFrame(counter=Counter(at=1, bits=4, shift=4)))
    counters = [integrity.put(b"\x00\x05")[1] for _ in range(18)]
    assert counters[:3] == [0x05, 0x15, 0x25]
    assert counters[15:] == [0xF5, 0x05, 0x15]


@pytest.mark.parametrize(
    ("kind", "header", "data", "protected"),
    [
        ("sum", True, "0102030405060000", "010203040506004F"),  # AgileX version 1, identifier 131h
        ("sum", False, "FF00", "FFFF"),
        ("xor", False, "0F0200", "0F020D"),
        ("crc8", False, "0000000000", "0000000059"),  # SAE J1850, four bytes of zero
    ],
)
def test_golden_checksums(kind, header, data, protected):
    at = len(bytes.fromhex(data)) - 1
    integrity = FrameIntegrity(0x131, ProtectedFrame(checksum=Checksum(at=at, kind=kind, header=header)))
    assert integrity.put(bytes.fromhex(data)) == bytes.fromhex(protected)


KINDS = ["sum", "xor", "crc8"]
sealings = st.builds(
    ProtectedFrame,
    counter=st.none() | st.just(Counter(at=6, bits=8)),
    checksum=st.builds(Checksum, at=st.just(7), kind=st.sampled_from(KINDS), header=st.booleans()),
)


@given(sealings, st.binary(min_size=8, max_size=8), st.integers(0, 7), st.integers(1, 255))
def test_a_protected_frame_is_valid_until_one_byte_is_wrong(protected, data, place, change):
    frame = bytearray(FrameIntegrity(0x111, protected).put(data))
    assert FrameIntegrity(0x111, protected).accepts(bytes(frame))
    frame[place] ^= change
    assert not FrameIntegrity(0x111, protected).accepts(bytes(frame))


def test_a_counter_that_stands_still_does_not_count():
    integrity = FrameIntegrity(0x111, ProtectedFrame(counter=Counter(at=0)))
    assert [integrity.accepts(bytes([count])) for count in (3, 3, 4, 4, 7)] == [
        True,
        False,
        True,
        False,
        True,
    ]
