"""Fields of packets that both versions of MQTT encode alike."""

import mqtt5
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud import fields


@pytest.mark.parametrize(
    ("size", "encoded"),
    [
        (0, b"\x00"),
        (127, b"\x7f"),
        (128, b"\x80\x01"),
        (16_383, b"\xff\x7f"),
        (16_384, b"\x80\x80\x01"),
        (2_097_151, b"\xff\xff\x7f"),
        (2_097_152, b"\x80\x80\x80\x01"),
        (268_435_455, b"\xff\xff\xff\x7f"),
    ],
)
def test_a_length_is_encoded_as_in_the_table_of_the_standard(size, encoded):
    assert fields.length(size) == encoded


@given(st.integers(0, 268_435_455))
def test_a_length_can_be_read_again(size):
    found = 0
    for place, byte in enumerate(fields.length(size)):
        found |= (byte & 0x7F) << 7 * place
    assert found == size
    assert all(byte & 0x80 for byte in fields.length(size)[:-1])
    assert not fields.length(size)[-1] & 0x80


@given(st.binary(max_size=300))
def test_binary_data_has_its_length_in_front(value):
    assert fields.binary(value) == len(value).to_bytes(2, "big") + value


@pytest.mark.parametrize(("text", "encoded"), [("", b"\0\0"), ("a", b"\0\1a"), ("\u00e4", b"\0\2\xc3\xa4")])
def test_a_text_is_counted_in_bytes(text, encoded):
    assert fields.text(text) == encoded


def test_a_field_is_bounded_in_bytes():
    assert len(fields.binary(bytes(0xFFFF))) == 0xFFFF + 2
    for encode, value in ((fields.binary, bytes(0x10000)), (fields.text, "\u00e4" * 0x8000)):
        with pytest.raises(ValueError, match="a text or binary field is longer than 65535 bytes"):
            encode(value)


def test_the_fields_are_those_of_the_other_codec():
    """A topic of 200 bytes makes the remaining length two bytes long."""
    topic = "t" * 200
    rest = fields.text(topic) + b"\0" + b"x"
    theirs = mqtt5.PublishPacket(topic, payload=b"x").write()
    assert bytes(theirs) == b"\x30" + fields.length(len(rest)) + rest
