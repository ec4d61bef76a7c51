"""A message of the usual form is read without the codec, and means the same."""

import contextlib
import itertools

import mqtt5
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fleet.cloud.inbound import HEAD, InboundPublish, reader, recover_publish
from fleet.cloud.packets import PacketDecoder, PacketFramer, encode
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError

LIMIT = 10_000
TOPICS = st.text(st.characters(codec="utf-8", exclude_characters="+#\0"), min_size=1, max_size=30) | st.just(
    "cyberwave/twin/x/command"
)
PAYLOADS = st.binary(max_size=300)
PANICS = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@st.composite
def publishes(draw):
    qos = draw(st.sampled_from([0, 0, 1, 1, 2]))
    return mqtt5.PublishPacket(
        draw(TOPICS),
        draw(PAYLOADS),
        qos=mqtt5.QoS(qos),
        packet_id=draw(st.integers(1, 65535)) if qos else None,
        retain=draw(st.booleans()),
        duplicate=bool(qos) and draw(st.booleans()),
        response_topic=draw(st.none() | st.just("reply")),
        correlation_data=draw(st.none() | st.binary(max_size=8)),
    )


def meaning(packet):
    """Return what counts of a packet, however it was read."""
    if isinstance(packet, InboundPublish):
        message = packet.message
        return (message.topic, message.payload, message.qos, packet.identifier, message.retain, None, None)
    if isinstance(packet, mqtt5.PublishPacket):
        asked = packet.response_topic, packet.correlation_data
        qos, identifier = int(packet.qos), packet.packet_id or 0
        return (packet.topic, packet.payload, qos, identifier, packet.retain, *asked)
    return repr(packet)


def meanings(packets):
    """Return what the packets mean, up to what makes no sense."""
    found = []
    try:
        found.extend(map(meaning, packets))
    except WireError:
        found.append("refused")
    return found


def read_both_ways(data, protocol=5):
    """Return what some bytes mean, here and by the codec alone."""
    here = meanings(PacketFramer(reader(protocol), LIMIT).feed(data))
    return here, meanings(PacketDecoder(protocol, LIMIT).feed(data))


@PANICS
@given(st.lists(publishes(), max_size=4))
def test_a_message_means_what_the_codec_says(packets):
    here, codec = read_both_ways(b"".join(packet.write() for packet in packets))
    assert here == codec


@PANICS
@given(publishes(), st.data())
def test_a_damaged_message_means_what_the_codec_says(packet, data):
    frame = bytearray(packet.write() + mqtt5.PingRespPacket().write())
    for _ in range(data.draw(st.integers(1, 3))):
        frame[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    here, codec = read_both_ways(bytes(frame))
    assert here == codec


@PANICS
@given(st.sampled_from([b"\x30", b"\x32"]), st.binary(max_size=12))
@example(b"\x30", b"\x00")
@example(b"\x32", b"\x05\x00\x01a\x00\x00")
@example(b"\x30", b"\x85\x00\x00\x01a\x00X")  # a length with a byte too many
def test_a_message_that_is_cut_short_means_what_the_codec_says(first, rest):
    here, codec = read_both_ways(first + rest)
    assert here == codec


@pytest.mark.parametrize("size", [1, 127, 128, 300, 9000])
@pytest.mark.parametrize("qos", [0, 1])
def test_the_usual_message_is_read_without_the_codec(size, qos):
    packet = mqtt5.PublishPacket("a/b", b"x" * size, qos=mqtt5.QoS(qos), packet_id=7 if qos else None)
    plain = InboundPublish(CloudMessage("a/b", b"x" * size, qos), 7 if qos else 0)
    assert list(PacketFramer(reader(5), LIMIT).feed(packet.write())) == [plain]


@pytest.mark.parametrize(
    "unusual",
    [{"retain": True}, {"response_topic": "r"}, {"correlation_data": b"1"}, {"message_expiry_interval": 1}],
)
def test_an_unusual_message_is_the_codecs(unusual):
    packet = mqtt5.PublishPacket("a/b", b"x", **unusual)
    (found,) = PacketFramer(reader(5), LIMIT).feed(packet.write())
    assert isinstance(found, mqtt5.PublishPacket)


def test_a_message_of_mqtt_3_1_1_is_the_codecs():
    packet = mqtt5.PublishPacket("a/b", b"x", qos=mqtt5.QoS(1), packet_id=3)
    here, codec = read_both_ways(encode(packet, 311), 311)
    assert here == codec == [("a/b", b"x", 1, 3, False, None, None)]


def salvage(data, protocol=5, size=None, limit=LIMIT):
    """Feed bytes, at most ``size`` at once, until they make no sense; return what can be told of them."""
    cutter = PacketFramer(reader(protocol), limit, head=HEAD)
    pieces = [data[start : start + (size or len(data))] for start in range(0, len(data), size or len(data))]
    with pytest.raises(WireError) as caught:
        list(itertools.chain.from_iterable(map(cutter.feed, pieces)))
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
