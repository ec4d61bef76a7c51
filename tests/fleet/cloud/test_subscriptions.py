"""What is subscribed in a session, in which packets, and what the broker makes of it."""

from itertools import count

import mqtt5
import pytest

from fleet.cloud.subscriptions import Subscriptions

GRANTED, REFUSED = mqtt5.SubAckReasonCode(1), mqtt5.SubAckReasonCode.NOT_AUTHORIZED


@pytest.fixture
def subscribed():
    """Return the subscriptions to these filters, whose packets are numbered from 1."""

    def subscribed(filters):
        numbers = count(1)
        return Subscriptions(filters, lambda: next(numbers))

    return subscribed


def asked(packets):
    """Return the filters of SUBSCRIBE packets, by packet identifier."""
    return {packet.packet_id: [each.pattern for each in packet.topic_filters] for packet in packets}


def many(number, first=0):
    return {f"t/{index}": 1 for index in range(first, first + number)}


def test_a_filter_is_asked_for_with_its_qos_and_without_our_own_messages(subscribed):
    (packet,) = subscribed({"a": 0, "b/+": 2}).begin()
    assert [(each.pattern, int(each.max_qos)) for each in packet.topic_filters] == [("a", 0), ("b/+", 2)]
    assert all(each.no_local and not each.retain_as_published for each in packet.topic_filters)


@pytest.mark.parametrize(
    ("number", "sizes"), [(0, []), (1, [1]), (64, [64]), (65, [64, 1]), (200, [64, 64, 64, 8])]
)
def test_many_filters_are_asked_for_in_several_packets(subscribed, number, sizes):
    packets = asked(subscribed(many(number)).begin())
    assert [len(patterns) for patterns in packets.values()] == sizes
    assert [pattern for patterns in packets.values() for pattern in patterns] == list(many(number))


def test_it_is_open_until_every_packet_is_answered(subscribed):
    subscriptions = subscribed(many(65))
    assert not subscriptions.open
    first, second = asked(subscriptions.begin())
    assert subscriptions.answered(mqtt5.SubAckPacket(second, [GRANTED])) == []
    assert subscriptions.open
    assert subscriptions.answered(mqtt5.SubAckPacket(first, [GRANTED] * 64)) == []
    assert not subscriptions.open


def test_a_refused_filter_is_named_with_the_reason(subscribed):
    subscriptions = subscribed({"a": 1, "b": 1, "c": 1, "d": 2})
    list(subscriptions.begin())
    codes = [GRANTED, REFUSED, mqtt5.SubAckReasonCode.UNSPECIFIED_ERROR, mqtt5.SubAckReasonCode(2)]
    assert subscriptions.answered(mqtt5.SubAckPacket(1, codes)) == [
        "the broker refuses the subscription b (NOT_AUTHORIZED)",
        "the broker refuses the subscription c (UNSPECIFIED_ERROR)",
    ]


@pytest.mark.parametrize(
    ("identifier", "codes"), [(1, []), (1, [GRANTED]), (1, [GRANTED] * 3), (9, [GRANTED])]
)
def test_an_answer_to_something_else_is_recognised(subscribed, identifier, codes):
    subscriptions = subscribed({"a": 1, "b": 1})
    list(subscriptions.begin())
    assert subscriptions.answered(mqtt5.SubAckPacket(identifier, codes)) is None


def test_a_new_connection_asks_for_all_again_and_awaits_no_old_answer(subscribed):
    subscriptions = subscribed({"a": 1})
    list(subscriptions.begin())
    assert asked(subscriptions.begin()) == {2: ["a"]}
    assert subscriptions.answered(mqtt5.SubAckPacket(1, [GRANTED])) is None
    assert subscriptions.open
    assert subscriptions.answered(mqtt5.SubAckPacket(2, [GRANTED])) == []


def test_a_change_asks_for_what_is_new_and_leaves_what_is_gone(subscribed):
    subscriptions = subscribed({"a": 1, "b": 1})
    list(subscriptions.begin())
    subscribe, unsubscribe = subscriptions.change({"b": 1, "c": 2})
    assert asked([subscribe]) == {2: ["c"]}
    assert (unsubscribe.packet_id, unsubscribe.patterns) == (3, ["a"])
    assert asked(subscriptions.begin()) == {4: ["b", "c"]}


def test_a_change_of_nothing_sends_nothing(subscribed):
    subscriptions = subscribed({"a": 1})
    assert list(subscriptions.change({"a": 1})) == []


def test_many_filters_are_left_in_several_packets(subscribed):
    packets = list(subscribed(many(130)).change({}))
    assert [len(packet.patterns) for packet in packets] == [64, 64, 2]
    assert [packet.packet_id for packet in packets] == [1, 2, 3]
