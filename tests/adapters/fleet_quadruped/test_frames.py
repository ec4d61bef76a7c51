import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fleet_quadruped.frames import FieldMap, FrameDecoder, FrameMap, encode

BATTERY = FrameMap(
    id=0x361,
    fields={
        "percent": FieldMap(at=0, type="u8", invalid=255),
        "voltage": FieldMap(at=1, type="u16", endian="big", scale=0.01),
        "current": FieldMap(at=3, type="i16", scale=0.1),
    },
)


def test_a_frame_is_read_by_its_map():
    found = FrameDecoder([BATTERY]).decode(0x361, bytes.fromhex("50129EF6FF"))
    assert found == pytest.approx({"percent": 80, "voltage": 47.66, "current": -1.0})


def test_an_invalid_value_is_left_out():
    assert "percent" not in FrameDecoder([BATTERY]).decode(0x361, bytes.fromhex("FF129EF6FF"))


def test_a_short_frame_and_a_strange_one_say_nothing():
    decoder = FrameDecoder([BATTERY])
    assert decoder.decode(0x361, b"\x50\x12") is None
    assert decoder.decode(0x362, bytes(8)) is None


def test_a_float_that_is_no_number_is_left_out():
    frame = FrameMap(id=1, fields={"x": FieldMap(at=0, type="f32")})
    assert FrameDecoder([frame]).decode(1, b"\x00\x00\xc0\x7f") == {}


def test_two_values_on_one_byte_are_refused():
    with pytest.raises(ValidationError, match="byte 1 is in both 'a' and 'b'"):
        FrameMap(id=1, fields={"a": FieldMap(at=0, type="u16"), "b": FieldMap(at=1, type="u8")})


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_what_does_not_fit_is_clamped_and_never_wrapped(voltage):
    found = FrameDecoder([BATTERY]).decode(0x361, encode(BATTERY, {"voltage": voltage}))
    assert found["voltage"] == pytest.approx(max(0.0, min(655.35, voltage)), abs=0.006)


def test_not_a_number_is_not_encoded():
    with pytest.raises(ValueError, match="current is not a number"):
        encode(BATTERY, {"current": math.nan})
