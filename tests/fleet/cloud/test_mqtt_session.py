import mqtt5
import pytest

from fleet.cloud.mqtt_session import INBOUND, MqttSession, SessionEnded, SessionRefused
from fleet.cloud.values import CloudStats
from fleet.spool.message import Outgoing
from fleet.testing.clock import ManualClock
from tests.fleet.cloud.talks import REFUSED, SETTINGS, Talk, a_box, ids, message, read


def test_connect_says_who_we_are_and_leaves_a_will():
    (packet,) = read(MqttSession(SETTINGS, {}, a_box(), CloudStats()).connect())
    assert (packet.client_id, packet.username, packet.password) == ("me", "u", b"p")
    assert (packet.clean_start, packet.session_expiry_interval, packet.keep_alive) == (True, 0, 5)
    assert (packet.will.topic, packet.will.payload, int(packet.will.qos)) == ("t", b"gone", 1)


def test_every_filter_is_asked_for_with_its_qos_and_without_our_own_messages():
    talk = Talk({f"a/{number}": number % 3 for number in range(100)})
    filters = [one for packet in talk.replies() for one in packet.topic_filters]
    assert {one.pattern: int(one.max_qos) for one in filters} == {f"a/{n}": n % 3 for n in range(100)}
    assert all(one.no_local and not one.retain_as_published for one in filters)


def test_nothing_is_sent_before_every_subscription_is_answered():
    talk = Talk({f"a/{number}": 0 for number in range(65)})
    talk.put(message("t"))
    for packet in talk.replies():
        assert talk.send() == []
        codes = [mqtt5.SubAckReasonCode(0)] * len(packet.topic_filters)
        talk.hear(mqtt5.SubAckPacket(packet.packet_id, codes))
    assert ids(talk.send()) == [("t", 3, False)]


def test_other_filters_are_asked_for_without_touching_those_that_stay():
    talk = Talk({"kept": 1, "gone": 1})
    talk.hear(mqtt5.SubAckPacket(talk.replies()[0].packet_id, [mqtt5.SubAckReasonCode(1)] * 2))
    talk.session.resubscribe({"kept": 1, "new": 2})
    subscribe, unsubscribe = talk.replies()
    assert [one.pattern for one in subscribe.topic_filters] == ["new"]
    assert unsubscribe.patterns == ["gone"]
    talk.put(message("t"))
    assert [packet.topic for packet in talk.send()] == ["t"], "what is sent waits for none of it"
    talk.hear(mqtt5.UnsubAckPacket(unsubscribe.packet_id, [mqtt5.UnsubAckReasonCode(0)]))
    talk.hear(mqtt5.SubAckPacket(subscribe.packet_id, [mqtt5.SubAckReasonCode(2)]))
    with pytest.raises(SessionEnded, match="unknown subscription"):
        talk.hear(mqtt5.SubAckPacket(unsubscribe.packet_id, [mqtt5.SubAckReasonCode(2)]))


def test_a_refused_subscription_is_named():
    talk = Talk({"mine": 1, "yours": 1})
    codes = [mqtt5.SubAckReasonCode(1), mqtt5.SubAckReasonCode.NOT_AUTHORIZED]
    talk.hear(mqtt5.SubAckPacket(1, codes))
    assert talk.session.problems == ["the broker refuses the subscription yours (NOT_AUTHORIZED)"]


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x84, "protocol"),
        (0x85, "client id"),
        (0x86, "password"),
        (0x87, "not allow"),
        (0x88, "available"),
        (0x89, "busy"),
        (0x8A, "banned"),
        (0x97, "quota"),
        (0x9F, "too often"),
        (0x80, "0x80"),
    ],
)
def test_a_refusal_says_why(code, words):
    with pytest.raises(SessionRefused, match=words):
        Talk(reason_code=mqtt5.ConnAckReasonCode(code), reason_str="said so")


def test_a_broker_without_qos_1_is_refused_by_us():
    with pytest.raises(SessionRefused, match="QoS 0"):
        Talk(max_qos=mqtt5.QoS(0))


def test_the_brokers_keepalive_and_packet_size_count():
    talk = Talk(server_keep_alive=2, max_packet_size=40)
    assert talk.session.keepalive == 2
    talk.put(Outgoing("t", b"x" * 100, 1))
    talk.put(message("small"))
    assert ids(talk.send()) == [("small", 2, False)]
    assert talk.outcomes() == REFUSED


def test_a_message_of_qos_2_is_handed_out_once():
    talk = Talk()
    twice = mqtt5.PublishPacket("t", b"x", qos=mqtt5.QoS(2), packet_id=5)
    talk.hear(twice, twice)
    assert len(talk.session.take_messages()) == 1
    talk.hear(mqtt5.PubRelPacket(5), mqtt5.PubRelPacket(5))
    codes = [int(packet.reason_code) for packet in talk.replies()]
    assert codes == [0, 0, 0, 0x92]
    talk.hear(twice)
    assert len(talk.session.take_messages()) == 1


def test_a_request_carries_where_to_answer():
    talk = Talk()
    request = mqtt5.PublishPacket(
        "t", b"x", qos=mqtt5.QoS(1), packet_id=5, response_topic="r", correlation_data=b"c"
    )
    talk.hear(request)
    (found,) = talk.session.take_messages()
    assert (found.topic, found.qos, found.response_topic, found.correlation) == ("t", 1, "r", b"c")
    assert talk.replies() == [mqtt5.PubAckPacket(5)]


@pytest.mark.parametrize(
    "packet",
    [
        mqtt5.ConnAckPacket(),
        mqtt5.ConnectPacket("x"),
        mqtt5.PingReqPacket(),
        mqtt5.AuthPacket(),
        mqtt5.PublishPacket("a", b"", topic_alias=1),
        mqtt5.SubAckPacket(9, [mqtt5.SubAckReasonCode(0)]),
    ],
)
def test_a_broker_that_breaks_the_protocol_is_left(packet):
    with pytest.raises(SessionEnded) as caught:
        Talk().hear(packet)
    assert caught.value.code == mqtt5.DisconnectReasonCode.PROTOCOL_ERROR


@pytest.mark.parametrize("packet", [mqtt5.PingRespPacket(), mqtt5.PublishPacket("t", b"x")])
def test_nothing_but_an_answer_to_connect_may_come_first(packet):
    session = MqttSession(SETTINGS, {}, a_box(), CloudStats())
    with pytest.raises(SessionEnded):
        session.receive(packet, 0.0)
    assert session.take_messages() == []


def test_a_message_of_the_usual_form_is_handed_out_and_acknowledged_by_its_qos():
    talk = Talk()
    talk.hear(mqtt5.PublishPacket("t", b"x"), mqtt5.PublishPacket("t", b"y", qos=mqtt5.QoS(1), packet_id=7))
    assert [one.payload for one in talk.session.take_messages()] == [b"x", b"y"]
    assert [packet.packet_id for packet in talk.replies()] == [7]


def test_too_many_qos_2_messages_under_way_end_the_session():
    talk = Talk()
    flood = [
        mqtt5.PublishPacket("t", b"", qos=mqtt5.QoS(2), packet_id=number) for number in range(1, INBOUND + 2)
    ]
    with pytest.raises(SessionEnded) as caught:
        talk.hear(*flood)
    assert caught.value.code == mqtt5.DisconnectReasonCode.RECEIVE_MAX_EXCEEDED
    assert talk.session.take_messages()[-1].flaw == "beyond the Receive Maximum", "it may be a stop"


@pytest.mark.parametrize(
    ("code", "error"),
    [(0x8B, SessionEnded), (0x8D, SessionEnded), (0x8E, SessionRefused), (0x98, SessionRefused)],
)
def test_the_reason_of_a_disconnect_decides_whether_haste_helps(code, error):
    with pytest.raises(error):
        Talk().hear(mqtt5.DisconnectPacket(reason_code=mqtt5.DisconnectReasonCode(code)))


def test_filters_that_are_changed_before_the_broker_answers_are_asked_for_once_and_all_are_awaited():
    box = a_box(CloudStats(), ManualClock())
    session = MqttSession(SETTINGS, {"a": 1}, box, CloudStats())
    session.resubscribe({"a": 1, "b": 1})
    assert session.take_replies() == b""
    session.receive(mqtt5.ConnAckPacket(), 0.0)
    (requested,) = read(session.take_replies())
    assert [each.pattern for each in requested.topic_filters] == ["a", "b"]
    codes = [mqtt5.SubAckReasonCode.GRANTED_QOS_AT_LEAST_ONCE, mqtt5.SubAckReasonCode.NOT_AUTHORIZED]
    session.receive(mqtt5.SubAckPacket(requested.packet_id, reason_codes=codes), 0.0)
    assert session.ready
    assert session.problems == ["the broker refuses the subscription b (NOT_AUTHORIZED)"]
