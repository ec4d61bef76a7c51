"""Of a message that cannot be read, what can be told is told: it may be a stop."""

import contextlib
import itertools

import mqtt5
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud.inbound import HEAD, reader, recover_publish
from fleet.cloud.packets import PacketFramer, encode
from fleet.errors import WireError

LIMIT = 10_000
PANICS = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


def salvage(data, protocol=5, size=None, limit=LIMIT):
    """Feed bytes, at most ``size`` at once, until they make no sense; return what can be told of them."""
    framer = PacketFramer(reader(protocol), limit, head=HEAD)
    pieces = [data[start : start + (size or len(data))] for start in range(0, len(data), size or len(data))]
    with pytest.raises(WireError) as caught:
        list(itertools.chain.from_iterable(map(framer.feed, pieces)))
    return recover_publish(caught.value)


@pytest.mark.parametrize("protocol", [5, 311])
@pytest.mark.parametrize("size", [None, 1, 7])
def test_of_a_message_that_is_too_large_the_topic_is_known(protocol, size):
    packet = mqtt5.PublishPacket("cyberwave/twin/x/command", b"x" * 5000, qos=mqtt5.QoS(1), packet_id=3)
    message = salvage(encode(packet, protocol), protocol, size, limit=4000)
    assert (message.topic, message.payload) == ("cyberwave/twin/x/command", b"")
    assert "larger than 4000" in message.flaw


@PANICS
@pytest.mark.parametrize("qos", [0, 1])
def test_of_a_message_whose_properties_are_no_text_the_payload_is_known(qos):
    packet = mqtt5.PublishPacket(
        "a/b", b"stop", qos=mqtt5.QoS(qos), packet_id=7 if qos else None, response_topic="rr"
    )
    message = salvage(packet.write().replace(b"rr", b"\xff\xff"))
    assert (message.topic, message.payload) == ("a/b", b"stop")
    assert message.flaw


def test_of_a_message_without_an_identifier_the_payload_is_known():
    assert salvage(b"\x32\x0a\x00\x01a\x00\x00stop!", 311).payload == b"stop!"
    assert salvage(b"\x32\x0b\x00\x01a\x00\x00\x00stop!").payload == b"stop!"


@pytest.mark.parametrize("data", [b"\x00\x00", b"\x30\x00", b"\x30\x02\x00\x09", b"\x40\x02\x00\x00"])
def test_what_is_no_message_has_none_to_be_known(data):
    assert salvage(data) is None


@PANICS
@given(st.binary(max_size=40))
def test_whatever_a_damaged_packet_holds_reading_it_ends(packet):
    with contextlib.suppress(WireError):
        list(PacketFramer(reader(5), 20, head=HEAD).feed(b"\x32" + packet))
