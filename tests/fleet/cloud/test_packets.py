import mqtt5
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.cloud.packets import PacketDecoder, PacketTooLarge, encode
from fleet.errors import WireError

STREAM = [
    mqtt5.PublishPacket("a/b", b"x" * 300, qos=mqtt5.QoS(1), packet_id=7, response_topic="r"),
    mqtt5.PingRespPacket(),
    mqtt5.PublishPacket("a", b""),
    mqtt5.PubAckPacket(9),
]
PANIC = b"\xe0\x08\x00\x06\x1f\x00\x03\x92ye"  # DISCONNECT whose reason is not UTF-8


def stream(protocol):
    return b"".join(encode(packet, protocol) for packet in STREAM)


@pytest.mark.parametrize("protocol", [5, 311])
@given(cuts=st.lists(st.integers(0, 340), max_size=8))
def test_packets_come_out_whole_however_the_bytes_are_cut(protocol, cuts):
    data, decoder, found = stream(protocol), PacketDecoder(protocol, 1000), []
    for start, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(data)], strict=True):
        found += decoder.feed(data[start:end])
    assert [type(packet) for packet in found] == [type(packet) for packet in STREAM]
    assert found[0].payload == b"x" * 300


@pytest.mark.parametrize("protocol", [5, 311])
@given(data=st.binary(max_size=60))
def test_garbage_is_read_or_refused_and_nothing_else(protocol, data):
    try:
        list(PacketDecoder(protocol, 1000).feed(data))
    except WireError:
        return


@settings(max_examples=400)
@given(st.data())
def test_damaged_packets_are_read_or_refused_and_nothing_else(data):
    frame = bytearray(stream(5) + mqtt5.DisconnectPacket(reason_str="bye").write())
    for _ in range(data.draw(st.integers(1, 3))):
        frame[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    try:
        list(PacketDecoder(5, 10_000).feed(bytes(frame)))
    except WireError:
        return


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (PANIC, "UTF-8"),
        (b"\x40\x02\x00\x00", "identifier"),
        (b"\x30\x05\x00\x02a\x00\x00", "NUL"),
        (b"\x20\x02\x00\x00", "not an MQTT packet"),
        (b"\x30\xff\xff\xff\xff\x01", "four bytes"),
        (b"\x40\x01\x00", "not an MQTT packet"),
        (b"\x00\x00", "not an MQTT packet"),
    ],
)
def test_malformed_packets_are_refused(data, why):
    with pytest.raises(WireError, match=why):
        list(PacketDecoder(5, 1000).feed(data))


def test_what_came_before_the_malformed_packet_still_counts():
    packets = PacketDecoder(5, 1000).feed(mqtt5.PingRespPacket().write() + b"\x00\x00")
    assert isinstance(next(packets), mqtt5.PingRespPacket)
    with pytest.raises(WireError):
        next(packets)


def test_a_packet_larger_than_agreed_is_refused_before_it_is_all_there():
    with pytest.raises(PacketTooLarge, match="200002"):
        list(PacketDecoder(5, 1000).feed(b"\x30\xbe\x9a\x0c\x00"))


@pytest.mark.parametrize("protocol", [5, 311])
def test_a_broker_learns_the_protocol_from_connect(protocol):
    decoder = PacketDecoder(None, 1000)
    data = encode(mqtt5.ConnectPacket("a", clean_start=True, keep_alive=5), protocol)
    (packet,) = decoder.feed(data)
    assert (decoder.protocol, packet.client_id, packet.keep_alive) == (protocol, "a", 5)


@pytest.mark.parametrize(
    "data", [b"\xc0\x00", b"\x10\x0c\x00\x04MQTT\x03\x02\x00\x3c\x00\x00", b"\x10\x02\x00\x04", b"\x10\x00"]
)
def test_a_broker_refuses_who_does_not_begin_with_a_connect_it_knows(data):
    with pytest.raises(WireError):
        list(PacketDecoder(None, 1000).feed(data))


def test_a_broker_without_mqtt_5_is_understood_when_it_says_so():
    (packet,) = PacketDecoder(5, 1000).feed(b"\x20\x02\x00\x01")
    assert packet.reason_code == mqtt5.ConnAckReasonCode.UNSUPPORTED_PROTOCOL_VERSION
