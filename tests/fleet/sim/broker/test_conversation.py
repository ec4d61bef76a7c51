"""The conversation with one client, packet by packet: each has its answer, or ends the connection."""

import mqtt5
import pytest

from fleet.sim.broker.broker_core import BrokerCore
from fleet.sim.broker.conversation import ClientError, Conversation
from fleet.sim.broker.faults import BrokerFaults
from fleet.sim.broker.limits import ClientLimits
from fleet.testing.clock import ManualClock

LIMITS = ClientLimits(receive=2, subscriptions=2, packet=1000, connect_timeout=7.0)
Connected = mqtt5.ConnAckReasonCode
Reason = mqtt5.DisconnectReasonCode
ONCE, TWICE = mqtt5.QoS.AT_LEAST_ONCE, mqtt5.QoS.EXACTLY_ONCE


class Bench:
    """A broker with one conversation."""

    def __init__(self, faults=None):
        self.hub = BrokerCore(ManualClock(), LIMITS, faults or BrokerFaults(), None)
        self.published, publish = [], self.hub.publish

        def published(packet, session):
            self.published.append(packet.topic)
            return publish(packet, session)

        self.hub.publish = published
        self.talk = Conversation(self.hub, self)

    def flush(self):
        pass

    def disconnect_client(self, reason):
        self.talk.end(reason)

    def connect(self, client="ann", protocol=5, **fields):
        (answer, *rest) = self.talk.receive(mqtt5.ConnectPacket(client, **fields), protocol)
        assert rest == []
        return answer

    def say(self, packet):
        """Return the only answer to a packet, None without one."""
        answers = self.talk.receive(packet, None)
        assert len(answers) < 2
        return answers[0] if answers else None

    def publish(self, qos=ONCE, identifier=1, **fields):
        return self.say(mqtt5.PublishPacket("a", b"x", qos=qos, packet_id=identifier, **fields))

    def subscribe(self, *patterns, qos=0):
        filters = [mqtt5.TopicFilter(pattern, max_qos=mqtt5.QoS(qos)) for pattern in patterns]
        return [int(code) for code in self.say(mqtt5.SubscribePacket(1, filters)).reason_codes]


@pytest.fixture
async def bench():
    return Bench()


@pytest.fixture
async def joined(bench):
    bench.connect()
    return bench


def error(bench, packet):
    with pytest.raises(ClientError) as caught:
        bench.talk.receive(packet, None)
    return caught.value.reason


async def test_a_client_has_some_time_to_connect_and_then_its_own_patience(bench):
    assert (bench.talk.patience, bench.talk.packet_limit) == (7.0, 1000)
    answer = bench.connect(keep_alive=10, max_packet_size=500)
    assert (bench.talk.patience, bench.talk.packet_limit) == (15.0, 500)
    assert (answer.reason_code, answer.receive_max, answer.max_packet_size) == (Connected.SUCCESS, 2, 1000)
    assert (answer.session_present, answer.assigned_client_id) == (False, None)
    assert not answer.shared_subscription_available


async def test_a_client_without_a_limit_takes_what_the_broker_takes_and_may_be_silent_for_ever(bench):
    bench.connect(keep_alive=0)
    assert (bench.talk.patience, bench.talk.packet_limit) == (0.0, 1000)


async def test_a_client_without_a_name_is_told_the_one_it_gets(bench):
    assert bench.connect("").assigned_client_id == bench.talk.session.client_id


REFUSED = [
    ({"will": mqtt5.Will("a\0", payload=b"")}, 5, Connected.TOPIC_NAME_INVALID),
    ({"client": "", "clean_start": False}, 311, Connected.CLIENT_ID_NOT_VALID),
    ({"authentication_method": "x"}, 5, Connected.BAD_AUTHENTICATION_METHOD),
]


@pytest.mark.parametrize(("fields", "protocol", "reason"), REFUSED)
async def test_a_client_that_is_refused_is_told_why_and_never_joins(bench, fields, protocol, reason):
    assert bench.connect(protocol=protocol, **fields).reason_code == reason
    assert (bench.talk.over, bench.talk.session, bench.hub.peers) == (True, None, {})


@pytest.mark.parametrize(("protocol", "clean"), [(5, False), (311, True)])
async def test_a_nameless_client_may_join_where_its_session_need_not_be_found_again(bench, protocol, clean):
    assert bench.connect("", protocol, clean_start=clean).reason_code == Connected.SUCCESS


async def test_nothing_may_come_before_connect_and_connect_only_once(bench):
    for packet in (mqtt5.PingReqPacket(), mqtt5.ConnAckPacket()):
        assert error(bench, packet) == Reason.PROTOCOL_ERROR
    bench.connect()
    for packet in (mqtt5.ConnectPacket("ann"), mqtt5.ConnAckPacket(), mqtt5.PingRespPacket()):
        assert error(bench, packet) == Reason.PROTOCOL_ERROR
    assert bench.say(mqtt5.PingReqPacket()) == mqtt5.PingRespPacket()


@pytest.mark.parametrize(("heard", "code"), [(True, 0), (False, 0x10)])
async def test_a_message_is_acknowledged_and_whether_somebody_heard_it(joined, heard, code):
    if heard:
        joined.subscribe("#")
    assert joined.publish(mqtt5.QoS.AT_MOST_ONCE, None) is None
    assert joined.publish(ONCE) == mqtt5.PubAckPacket(1, reason_code=mqtt5.PubAckReasonCode(code))
    assert joined.publish(TWICE) == mqtt5.PubRecPacket(1, reason_code=mqtt5.PubRecReasonCode(code))


async def test_a_broker_that_loses_acknowledgements_still_delivers():
    bench = Bench(BrokerFaults(no_puback=True))
    bench.connect()
    assert (bench.publish(ONCE), bench.published) == (None, ["a"])


async def test_a_message_that_is_to_go_once_is_routed_once_however_often_it_comes(joined):
    for _ in range(3):
        assert joined.publish(TWICE).packet_id == 1
    assert joined.published == ["a"]
    done, unknown = (joined.say(mqtt5.PubRelPacket(1)) for _ in range(2))
    assert (int(done.reason_code), int(unknown.reason_code)) == (0, 0x92)
    joined.publish(TWICE)
    assert joined.published == ["a", "a"], "the identifier was free again"


async def test_more_messages_under_way_than_the_broker_takes_end_the_connection(joined):
    for identifier in (1, 2, 1):
        joined.publish(TWICE, identifier)
    packet = mqtt5.PublishPacket("a", b"x", qos=TWICE, packet_id=3)
    assert error(joined, packet) == Reason.RECEIVE_MAX_EXCEEDED


async def test_a_topic_alias_was_never_offered(joined):
    assert error(joined, mqtt5.PublishPacket("a", b"", topic_alias=1)) == Reason.TOPIC_ALIAS_INVALID


async def test_each_filter_has_its_own_answer(joined):
    assert joined.subscribe("a", "$share/g/a", qos=2) == [2, 0x9E]
    assert joined.subscribe("b", "c", "a", qos=1) == [1, 0x97, 1], "a is there already"
    answer = joined.say(mqtt5.UnsubscribePacket(1, ["a", "x"]))
    assert [int(code) for code in answer.reason_codes] == [0, 0x11]
    assert joined.subscribe("c") == [0]


@pytest.mark.parametrize("pattern", ["", "a\0"])
async def test_a_filter_that_there_cannot_be_ends_the_connection(joined, pattern):
    packet = mqtt5.SubscribePacket(1, [mqtt5.TopicFilter(pattern)])
    assert error(joined, packet) == Reason.TOPIC_FILTER_INVALID


WILL = mqtt5.Will("will", payload=b"gone")


@pytest.mark.parametrize(
    ("end", "published"),
    [
        (lambda bench: bench.say(mqtt5.DisconnectPacket()), []),
        (
            lambda bench: bench.say(mqtt5.DisconnectPacket(reason_code=Reason.DISCONNECT_WITH_WILL_MESSAGE)),
            ["will"],
        ),
        (lambda bench: bench.talk.leave(), ["will"]),
        (lambda bench: bench.talk.end(Reason.KEEP_ALIVE_TIMEOUT), ["will"]),
    ],
)
async def test_a_will_is_published_once_unless_the_client_says_goodbye(bench, end, published):
    bench.connect(will=WILL)
    end(bench)
    bench.talk.leave()
    assert (bench.published, bench.talk.session, bench.hub.peers) == (published, None, {})


@pytest.mark.parametrize(("protocol", "told"), [(5, True), (311, False)])
async def test_only_a_client_of_the_newer_version_is_told_why_the_broker_ends_it(bench, protocol, told):
    bench.connect(protocol=protocol)
    answers = bench.talk.end(Reason.SERVER_SHUTTING_DOWN)
    assert [packet.reason_code for packet in answers] == [Reason.SERVER_SHUTTING_DOWN] * told
    assert (bench.talk.over, bench.talk.end(Reason.SERVER_SHUTTING_DOWN)) == (True, [])


@pytest.mark.parametrize(("first", "last", "expiry"), [(9, None, 9), (9, 0, 0), (9, 3, 3), (0, 0, 0)])
async def test_a_client_may_change_how_long_its_session_lasts_when_it_leaves(bench, first, last, expiry):
    bench.connect(session_expiry_interval=first)
    session = bench.talk.session
    bench.say(mqtt5.DisconnectPacket(session_expiry_interval=last))
    assert (session.expiry, bench.talk.over) == (expiry, True)


async def test_a_session_that_was_to_end_cannot_be_made_to_last(joined):
    packet = mqtt5.DisconnectPacket(session_expiry_interval=5)
    assert error(joined, packet) == Reason.PROTOCOL_ERROR
