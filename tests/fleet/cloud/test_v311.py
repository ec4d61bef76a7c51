import mqtt5
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud import v311
from fleet.cloud.packets import frame_length

ID = st.integers(1, 0xFFFF)
TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)
TOPIC = TEXT.filter(lambda text: text and "+" not in text and "#" not in text)
QOS = st.integers(0, 2).map(mqtt5.QoS)
PAYLOAD = st.binary(max_size=300)
WILL = st.builds(mqtt5.Will, TOPIC, payload=PAYLOAD, qos=QOS, retain=st.booleans())
FILTER = st.builds(mqtt5.TopicFilter, TOPIC, max_qos=QOS, retain_as_published=st.just(value=False))


@st.composite
def connects(draw):
    username = draw(st.none() | TEXT)
    clean = draw(st.booleans())
    return mqtt5.ConnectPacket(
        draw(TEXT),
        username=username,
        password=None if username is None else draw(st.none() | PAYLOAD),
        clean_start=clean,
        will=draw(st.none() | WILL),
        keep_alive=draw(st.integers(0, 0xFFFF)),
        session_expiry_interval=0 if clean else v311.NEVER,
    )


@st.composite
def publishes(draw):
    qos = draw(st.integers(0, 2))
    return mqtt5.PublishPacket(
        draw(TOPIC),
        draw(PAYLOAD),
        qos=mqtt5.QoS(qos),
        retain=draw(st.booleans()),
        packet_id=draw(ID) if qos else None,
        duplicate=bool(qos) and draw(st.booleans()),
    )


PACKETS = st.one_of(
    connects(),
    publishes(),
    st.builds(
        mqtt5.ConnAckPacket,
        session_present=st.just(value=False),
        reason_code=st.sampled_from([0, 0x84, 0x85, 0x86, 0x87, 0x88]).map(mqtt5.ConnAckReasonCode),
    ),
    st.builds(mqtt5.SubscribePacket, ID, st.lists(FILTER, min_size=1, max_size=4)),
    st.builds(
        mqtt5.SubAckPacket,
        ID,
        st.lists(st.sampled_from([0, 1, 2, 0x80]).map(mqtt5.SubAckReasonCode), min_size=1),
    ),
    st.builds(mqtt5.UnsubscribePacket, ID, st.lists(TOPIC, min_size=1, max_size=4)),
    st.builds(mqtt5.UnsubAckPacket, ID, st.just([])),
    *(
        st.builds(kind, ID)
        for kind in (mqtt5.PubAckPacket, mqtt5.PubRecPacket, mqtt5.PubRelPacket, mqtt5.PubCompPacket)
    ),
    st.sampled_from([mqtt5.PingReqPacket(), mqtt5.PingRespPacket(), mqtt5.DisconnectPacket()]),
)


@given(PACKETS)
def test_every_packet_comes_back_as_it_was(packet):
    frame = v311.write(packet)
    assert frame_length(frame) == len(frame)
    # The codec compares packets of some kinds by identity; what they show is all that they hold.
    assert v311.read(memoryview(frame)) == packet


@given(PACKETS, st.data())
def test_damaged_bytes_are_read_or_refused_and_nothing_else(packet, data):
    frame = bytearray(v311.write(packet))
    frame[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    if frame_length(bytes(frame[:4])) != len(frame):
        return
    try:
        v311.read(memoryview(bytes(frame)))
    except ValueError:
        return


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        (b"\x00\x00", "does not exist"),
        (b"\xf0\x00", "does not exist"),
        (b"\xc1\x00", "flags"),
        (b"\xc0\x01\x00", "after its end"),
        (b"\x40\x02\x00\x00", "identifier is 0"),
        (b"\x40\x01\x00", "ends inside"),
        (b"\x38\x04\x00\x01aX", "QoS 0"),
        (b"\x30\x02\x00\x00", "no topic"),
        (b"\x36\x06\x00\x01a\x00\x01X", "QoS"),
        (b"\x30\x04\x00\x02a\x00", "NUL"),
        (b"\x30\x04\x00\x02\xc3\x28", "utf-8"),
        (b"\x90\x03\x00\x01\x03", "unknown code"),
        (b"\xa2\x02\x00\x01", "no filter"),
        (b"\x20\x02\x02\x00", "answer to CONNECT"),
        (b"\x10\x0c\x00\x04MQTT\x05\x02\x00\x3c\x00\x00", "does not speak"),
        (b"\x10\x0c\x00\x04MQTT\x04\x03\x00\x3c\x00\x00", "contradict"),
        (b"\x10\x0c\x00\x04MQTT\x04\x40\x00\x3c\x00\x00", "contradict"),
        (b"\x10\x0c\x00\x04MQTT\x04\x20\x00\x3c\x00\x00", "contradict"),
    ],
)
def test_what_the_standard_forbids_is_refused(frame, why):
    with pytest.raises(ValueError, match=why):
        v311.read(memoryview(frame))


def test_what_3_1_1_cannot_say_is_left_out_or_refused():
    full = mqtt5.PublishPacket("a", b"x", response_topic="b", user_properties=[("c", "d")])
    assert v311.write(full) == b"\x30\x04\x00\x01ax"
    with pytest.raises(ValueError, match="AuthPacket"):
        v311.write(mqtt5.AuthPacket())
    with pytest.raises(ValueError, match="user name"):
        v311.write(mqtt5.ConnectPacket("a", password=b"x"))


def test_a_reason_that_3_1_1_does_not_know_becomes_server_unavailable():
    busy = mqtt5.ConnAckPacket(reason_code=mqtt5.ConnAckReasonCode.SERVER_BUSY)
    assert v311.write(busy) == b"\x20\x02\x00\x03"
