"""Messages in flight: no more than the broker allows, each with one outcome, and none lost or swapped."""

import itertools

import mqtt5
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from fleet.cloud.inflight_window import WINDOW
from fleet.cloud.publish import publish
from fleet.spool.message import Outgoing
from fleet.wire.rules import TrafficClass
from tests.fleet.cloud.talks import ACKED, HELD, REFUSED, Talk, ids, message, read


@pytest.mark.parametrize("wrong", [{"payload": "text"}, {"content_type": "\ud800"}, {"correlation": "text"}])
def test_a_message_that_cannot_be_written_harms_no_other(wrong):
    talk = Talk()
    talk.put(Outgoing(**{"topic": "bad", "payload": b"", "qos": 1} | wrong))
    talk.put(message("good"))
    assert ids(talk.send()) == [("good", 2, False)]
    assert talk.outcomes() == REFUSED


@pytest.mark.parametrize(("receive_max", "room"), [(16, 16), (65535, WINDOW)])
def test_no_more_is_under_way_than_the_broker_and_we_allow(receive_max, room):
    talk = Talk(receive_max=receive_max)
    for number in range(WINDOW + 2):
        talk.put(message(str(number), traffic=TrafficClass.REPLY))
    assert len(talk.send()) == room
    talk.hear(mqtt5.PubAckPacket(1), mqtt5.PubAckPacket(2))
    assert ids(talk.send()) == [(str(room), room + 1, False), (str(room + 1), room + 2, False)]


def test_part_of_the_window_is_kept_for_urgent_messages():
    talk = Talk(receive_max=16)
    for number in range(30):
        talk.put(message(str(number)))
    assert len(talk.send()) == 14
    talk.put(message("stop", traffic=TrafficClass.REPLY))
    assert ids(talk.send()) == [("stop", 15, False)]


@pytest.mark.parametrize(("code", "outcome"), [(0, ACKED), (0x87, REFUSED), (0x99, REFUSED)])
def test_an_acknowledgement_tells_what_became_of_the_message(code, outcome):
    talk = Talk()
    talk.put(message("t"))
    talk.send()
    talk.clock.advance(0.5)
    talk.hear(mqtt5.PubAckPacket(1, reason_code=mqtt5.PubAckReasonCode(code)))
    assert talk.outcomes() == outcome
    assert talk.stats.rtt == 0.5
    assert talk.send() == []
    assert not talk.session.busy()
    assert (talk.stats.refused, talk.box.spool.lost) == ((1, 1) if code else (0, 0))


@pytest.mark.parametrize("kind", [OverflowError, SystemError])
def test_a_message_that_cannot_be_encoded_takes_no_other_along(monkeypatch, kind):
    def fail(outgoing, *rest):
        if outgoing.topic == "b":
            raise kind("oops")
        return publish(outgoing, *rest)

    monkeypatch.setattr("fleet.cloud.inflight_window.publish", fail)
    talk = Talk()
    for name in "abc":
        talk.put(message(name))
    assert [topic for topic, _, _ in ids(talk.send())] == ["a", "c"]
    assert talk.outcomes() == REFUSED


def test_a_message_of_qos_2_does_not_keep_the_round_trip_from_being_measured():
    talk = Talk()
    talk.put(message("offer", qos=2))
    talk.send()
    talk.put(message("t"))
    talk.send()
    talk.clock.advance(0.25)
    talk.hear(mqtt5.PubAckPacket(2))
    assert talk.stats.rtt == 0.25


@pytest.mark.parametrize("code", [0x10, 0x97])
def test_what_nobody_hears_or_the_broker_has_no_room_for_is_sent_again(code):
    talk = Talk()
    talk.put(message("t"))
    talk.send()
    talk.hear(mqtt5.PubAckPacket(1, reason_code=mqtt5.PubAckReasonCode(code)))
    assert (talk.outcomes(), talk.send()) == (HELD, [])
    talk.clock.advance(1.0)
    talk.box.tick()
    assert ids(talk.send()) == [("t", 2, True)]
    talk.hear(mqtt5.PubAckPacket(2))
    assert talk.stats.acked == 1


def test_a_refusal_is_reported_once_for_each_reason(caplog):
    talk = Talk()
    for name in "abc":
        talk.put(message(name))
    for packet in talk.send():
        talk.hear(mqtt5.PubAckPacket(packet.packet_id, reason_code=mqtt5.PubAckReasonCode(0x87)))
    assert [record.message for record in caplog.records] == [
        "the broker refuses a message to a: NOT_AUTHORIZED"
    ]
    assert talk.stats.refused == 3


def test_what_was_not_acknowledged_is_sent_again_in_order_as_duplicates():
    talk = Talk()
    for name in "abc":
        talk.put(message(name))
    talk.send()
    talk.hear(mqtt5.PubAckPacket(2))
    talk.session.end()
    talk.put(message("d"))
    again = Talk(box=talk.box, clock=talk.clock)
    assert ids(again.send()) == [("a", 1, True), ("c", 2, True), ("d", 3, False)]


def test_the_time_that_is_left_goes_along_in_whole_seconds():
    talk = Talk()
    talk.put(message("t", expiry=10.0))
    talk.put(message("u", expiry=8.0))
    talk.clock.advance(8.1)
    (packet,) = talk.send()
    assert packet.message_expiry_interval == 2
    assert talk.box.spool.lost == 1


class Deliveries(RuleBasedStateMachine):
    """Nothing is lost or swapped, whatever order messages, acknowledgements, holds and falls come in."""

    def __init__(self):
        super().__init__()
        self.talk = Talk(receive_max=8)
        self.put = 0
        self.open = []
        self.arrived = {topic: [] for topic in "abc"}
        self.receive = dict.fromkeys("abc", True)

    @rule(topic=st.sampled_from("abc"))
    def publish(self, topic):
        self.talk.put(Outgoing(topic, b"%d" % self.put, 1))
        self.put += 1

    @rule()
    def send(self):
        self.open += [(packet.packet_id, packet.topic, int(packet.payload)) for packet in self.talk.send()]

    @rule(topic=st.sampled_from("abc"))
    def come_or_go(self, topic):
        if not any(topic == other for _, other, _ in self.open):
            self.receive[topic] = not self.receive[topic]

    @rule(share=st.integers(1, 8))
    def acknowledge(self, share):
        """Acknowledge the oldest, as a broker does."""
        answered, self.open = self.open[:share], self.open[share:]
        for identifier, topic, number in answered:
            self._answer(identifier, topic, number)

    def _answer(self, identifier, topic, number):
        code = mqtt5.PubAckReasonCode(0 if self.receive[topic] else 0x10)
        if self.receive[topic] and number not in self.arrived[topic]:
            self.arrived[topic].append(number)
        self.talk.hear(mqtt5.PubAckPacket(identifier, reason_code=code))

    @rule(seconds=st.sampled_from([0.1, 1.0, 20.0]))
    def wait(self, seconds):
        self.talk.clock.advance(seconds)
        self.talk.box.tick()

    @rule()
    def fall(self):
        for _, topic, number in self.open[: len(self.open) // 2]:  # acknowledged, and that was lost
            if self.receive[topic] and number not in self.arrived[topic]:
                self.arrived[topic].append(number)
        self.open.clear()
        self.talk.session.end()
        self.talk = Talk(box=self.talk.box, clock=self.talk.clock, receive_max=8)

    @invariant()
    def the_window_holds_and_each_topic_is_in_order(self):
        assert len(self.open) <= 8
        for numbers in self.arrived.values():
            assert numbers == sorted(numbers)

    def teardown(self):
        self.receive = dict.fromkeys("abc", True)
        for _ in range(self.put + 40):
            self.send()
            self.acknowledge(8)
            self.wait(20.0)
        assert sorted(itertools.chain(*self.arrived.values())) == list(range(self.put))
        assert self.talk.box.spool.waiting == 0


TestDeliveries = Deliveries.TestCase
TestDeliveries.settings = settings(max_examples=40, stateful_step_count=40)


def test_a_message_of_qos_2_is_released_once_the_broker_has_it():
    talk = Talk()
    talk.put(message("offer", 2))
    (published,) = talk.send()
    talk.hear(mqtt5.PubRecPacket(published.packet_id))
    (release,) = talk.replies()
    assert (type(release), release.packet_id) == (mqtt5.PubRelPacket, published.packet_id)
    assert talk.stats.acked == 0
    talk.hear(mqtt5.PubCompPacket(published.packet_id))
    assert talk.stats.acked == 1
    assert talk.send() == []
    assert not talk.session.busy()


def test_a_message_of_qos_2_that_was_not_completed_is_sent_again():
    talk = Talk()
    talk.put(message("offer", 2))
    (published,) = talk.send()
    talk.hear(mqtt5.PubRecPacket(published.packet_id))
    talk.session.end()
    (again,) = Talk(box=talk.box, clock=talk.clock).send()
    assert (again.topic, int(again.qos), again.duplicate) == ("offer", 2, True)


def test_a_message_of_qos_2_that_the_broker_refuses_is_reported_and_not_released():
    talk = Talk()
    talk.put(message("offer", 2))
    (published,) = talk.send()
    talk.hear(mqtt5.PubRecPacket(published.packet_id, reason_code=mqtt5.PubRecReasonCode.NOT_AUTHORIZED))
    assert talk.outcomes() == REFUSED
    assert talk.replies() == []


def test_a_refusal_of_a_message_that_is_not_in_flight_is_not_answered(caplog):
    talk = Talk()
    talk.hear(mqtt5.PubRecPacket(7, reason_code=mqtt5.PubRecReasonCode.PACKET_ID_IN_USE))
    assert talk.replies() == []
    assert "message 7, which is not in flight" in caplog.text


def test_a_message_that_the_broker_has_and_is_not_in_flight_is_released_as_unknown():
    talk = Talk()
    talk.hear(mqtt5.PubRecPacket(7))
    (release,) = talk.replies()
    assert release == mqtt5.PubRelPacket(7, reason_code=mqtt5.PubRelReasonCode.PACKET_ID_NOT_FOUND)


def test_a_broker_without_qos_2_gets_qos_1():
    talk = Talk(max_qos=mqtt5.QoS(1))
    talk.put(message("offer", 2))
    (published,) = talk.send()
    talk.hear(mqtt5.PubAckPacket(published.packet_id))
    assert int(published.qos) == 1
    assert talk.stats.acked == 1


def test_qos_2_takes_one_place_of_the_window():
    talk = Talk(receive_max=20)
    for number in range(30):
        talk.put(message(f"t/{number}", 2))
    assert 15 <= len(talk.send()) <= 20


def test_what_is_durable_goes_before_qos_0_and_its_window_does_not_hold_that_up():
    talk = Talk(receive_max=16)
    talk.light("state")
    for number in range(20):
        talk.put(message(str(number)))
    assert [packet.topic for packet in talk.send()] == [*map(str, range(14)), "state"]
    talk.light("state")
    assert [(packet.topic, packet.packet_id) for packet in talk.send()] == [("state", None)]


def test_a_backlog_leaves_room_for_qos_0_in_each_write():
    talk = Talk()
    for number in range(WINDOW):
        talk.put(Outgoing(f"t/{number}", b"x" * 1000, 1))
        talk.light("state", b"x" * 1000)
    for _ in range(5):
        topics = [packet.topic for packet in read(talk.session.send(talk.clock.monotonic()))]
        assert "state" in topics
        assert topics.count("state") < len(topics)


def test_qos_0_goes_with_the_time_that_is_left():
    talk = Talk()
    talk.light("late", expiry=1.0)
    talk.light("timely", expiry=10.0)
    talk.clock.advance(2.5)
    (packet,) = talk.send()
    assert (packet.topic, packet.message_expiry_interval) == ("timely", 8)
    assert talk.stats.sent == 1


def test_a_message_of_qos_0_that_the_broker_would_not_take_harms_no_other():
    talk = Talk(max_packet_size=40)
    talk.light("t", b"x" * 100)
    talk.light("good")
    assert [packet.topic for packet in talk.send()] == ["good"]
    assert talk.outcomes() == REFUSED
    assert talk.stats.sent == 1
