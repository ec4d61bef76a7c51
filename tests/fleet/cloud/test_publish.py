import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud.packets import PacketDecoder
from fleet.cloud.publish import QueuedQos0, publish, publish_qos0, qos0_route
from fleet.spool.message import Outgoing

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0+#"), min_size=1, max_size=40)
LIMIT = 1 << 20


def only(data, protocol):
    (packet,) = PacketDecoder(protocol, LIMIT).feed(data)
    return packet


MESSAGES = st.builds(
    Outgoing,
    TEXT,
    st.binary(max_size=300) | st.integers(16_000, 17_000).map(bytes),
    st.integers(1, 2),
    content_type=st.none() | TEXT,
    correlation=st.none() | st.binary(max_size=200),
    deadline=st.none() | st.floats(-1e3, 1e11),
    again=st.booleans(),
)


@pytest.mark.parametrize("protocol", [5, 311])
@given(message=MESSAGES)
def test_the_codec_reads_what_is_written(protocol, message):
    packet = only(publish(message, 77, 1000.0, protocol), protocol)
    assert (packet.topic, packet.payload, int(packet.qos)) == (message.topic, message.payload, message.qos)
    assert (packet.packet_id, packet.duplicate, packet.retain) == (77, message.again, False)
    if protocol == 5:
        assert (packet.content_type, packet.correlation_data) == (message.content_type, message.correlation)
        assert (packet.message_expiry_interval is None) == (message.deadline is None)


@pytest.mark.parametrize("protocol", [5, 311])
def test_a_message_of_qos_0_has_no_identifier(protocol):
    packet = only(publish_qos0(QueuedQos0(qos0_route("t", None), b"x", 0.0), 0.0, protocol), protocol)
    assert (packet.topic, packet.payload, int(packet.qos), packet.packet_id) == ("t", b"x", 0, None)


@pytest.mark.parametrize("protocol", [5, 311])
@given(TEXT, st.binary(max_size=300), st.none() | st.floats(0.001, 1e11), st.floats(0, 0.999))
def test_the_codec_reads_messages_of_qos_0(protocol, topic, payload, expiry, part):
    waited = 1e9 if expiry is None else expiry * part
    message = QueuedQos0(qos0_route(topic, expiry), payload, 0.0)
    packet = only(publish_qos0(message, waited, protocol), protocol)
    assert (packet.topic, packet.payload, int(packet.qos)) == (topic, payload, 0)
    if protocol == 5:
        assert (packet.message_expiry_interval is None) == (expiry is None)
    if protocol == 5 and expiry is not None:
        left = expiry - waited
        assert left - 1e-4 <= packet.message_expiry_interval <= max(1, left + 1) or left > 0xFFFF_FFFF


def test_a_message_of_qos_0_is_late_when_nothing_is_left_of_its_time():
    assert [QueuedQos0(qos0_route("t", 2.0), b"x", 5.0).is_late(now) for now in (6.9, 7.0)] == [
        False,
        True,
    ]
    assert not QueuedQos0(qos0_route("t", None), b"x", 5.0).is_late(1e9)


@pytest.mark.parametrize(("left", "seconds"), [(0.2, 1), (-5.0, 1), (7.0, 7), (7.01, 8), (1e12, 0xFFFF_FFFF)])
def test_the_time_that_is_left_is_reported_in_whole_seconds_and_never_as_none(left, seconds):
    message = Outgoing("t", b"", 1, deadline=1000.0 + left)
    assert only(publish(message, 1, 1000.0, 5), 5).message_expiry_interval == seconds
    light = QueuedQos0(qos0_route("t", left), b"", 0.0)
    assert only(publish_qos0(light, 0.0, 5), 5).message_expiry_interval == seconds


def test_what_has_waited_tells_what_is_left_of_its_time():
    message = QueuedQos0(qos0_route("t", 10.0), b"x", 0.0)
    packets = [only(publish_qos0(message, waited, 5), 5) for waited in (0.0, 0.99, 1.01, 9.99)]
    assert [each.message_expiry_interval for each in packets] == [10, 10, 9, 1]


@pytest.mark.parametrize("topic", ["x" * 65_536, "\ud800"])
def test_a_topic_that_no_packet_holds_is_an_error(topic):
    with pytest.raises(ValueError, match=r"65535 bytes|surrogates"):
        publish(Outgoing(topic, b"", 0), None, 0.0, 5)
