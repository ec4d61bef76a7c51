"""The messages of one topic: their order, and whether they may be sent."""

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.spool.message import Outgoing
from fleet.spool.topic_queue import TopicEvent, TopicQueue, TopicState
from fleet.wire.rules import TrafficClass

HELD, OPEN, PROBE = TopicState.HELD, TopicState.OPEN, TopicState.PROBE
HEARD, UNHEARD = TopicEvent.HEARD, TopicEvent.UNHEARD
WAITED, CONNECTED = TopicEvent.WAITED, TopicEvent.CONNECTED
REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT

CHANGES = {
    (PROBE, HEARD): OPEN,
    (PROBE, UNHEARD): HELD,
    (OPEN, UNHEARD): HELD,
    (OPEN, CONNECTED): PROBE,
    (HELD, HEARD): PROBE,
    (HELD, WAITED): PROBE,
    (HELD, CONNECTED): PROBE,
}


def message(seq):
    return Outgoing("t", b"", 1, seq=seq)


def queue(*seqs, state=PROBE, traffic=EVENT, in_flight=0):
    made = TopicQueue("t", traffic)
    made.state, made.in_flight = state, in_flight
    made.memory.extend(map(message, seqs))
    return made


def popped(topic):
    order = []
    while topic.back or topic.memory:
        order.append(topic.pop().seq)
    return order


@pytest.mark.parametrize(("state", "event"), list(product(TopicState, TopicEvent)))
def test_an_event_changes_the_state_as_the_table_says_and_nothing_else_does(state, event):
    topic = queue(state=state)
    changed = topic.transition(event)
    assert topic.state is CHANGES.get((state, event), state)
    assert changed is ((state, event) in CHANGES)


@pytest.mark.parametrize(
    ("state", "in_flight", "sendable"),
    [
        (PROBE, 0, True),
        (PROBE, 1, False),
        (OPEN, 0, True),
        (OPEN, 50, True),
        (HELD, 0, False),
        (HELD, 1, False),
    ],
)
def test_an_unknown_topic_sends_one_message_an_open_one_many_and_a_held_one_none(state, in_flight, sendable):
    topic = queue(1, 2, state=state, in_flight=in_flight)
    assert topic.sendable is sendable
    topic.back, topic.memory = [topic.memory[0]], topic.memory.__class__()
    assert topic.sendable is sendable


@pytest.mark.parametrize("state", TopicState)
def test_a_topic_without_messages_in_memory_sends_nothing(state):
    topic = queue(state=state)
    topic.on_disk = 5
    assert not topic.sendable


@pytest.mark.parametrize("field", ["back", "memory", "on_disk", "in_flight"])
def test_a_topic_is_empty_when_no_message_is_anywhere(field):
    topic = queue()
    assert topic.empty
    setattr(topic, field, 1 if field in ("on_disk", "in_flight") else [message(1)])
    assert not topic.empty


def test_a_new_topic_is_unknown_and_has_nothing_anywhere():
    topic = TopicQueue("t", STATUS)
    assert (topic.topic, topic.traffic, topic.state) == ("t", STATUS, PROBE)
    assert (topic.loaded, topic.oldest_on_disk, topic.ahead, topic.in_flight) == (0, 0, frozenset(), 0)
    assert (topic.unsubscribed, topic.retry, topic.queued) == (0, 0.0, False)
    assert topic.sendable is False


def test_what_is_in_flight_does_not_wait():
    topic = queue(4, 5, in_flight=7)
    topic.back.append(message(3))
    topic.on_disk = 10
    assert topic.waiting == 13


@pytest.mark.parametrize("field", ["back", "memory", "on_disk"])
def test_an_open_topic_is_quiet_until_a_message_waits(field):
    topic = queue(state=OPEN, in_flight=3)
    assert topic.quiet
    setattr(topic, field, 1 if field == "on_disk" else [message(1)])
    assert not topic.quiet


@pytest.mark.parametrize(
    ("state", "traffic", "quiet"),
    [(OPEN, STATUS, True), (OPEN, REPLY, False), (PROBE, EVENT, False), (HELD, EVENT, False)],
)
def test_an_inbox_or_a_topic_that_is_not_open_needs_a_decision(state, traffic, quiet):
    assert queue(state=state, traffic=traffic).quiet is quiet


def test_returned_messages_go_first_and_are_marked_as_sent_before():
    topic = queue(3, 4)
    for seq in (2, 1):
        topic.requeue(message(seq))
    assert all(one.again for one in topic.back)
    assert not any(one.again for one in topic.memory)
    assert popped(topic) == [1, 2, 3, 4]


@given(st.permutations(range(8)), st.integers(0, 8))
def test_messages_return_in_order_whatever_order_they_come_back_in(order, split):
    topic = queue(8, 9)
    for seq in order[:split]:
        topic.requeue(message(seq))
    assert [one.seq for one in topic.back] == sorted(order[:split])
    for seq in order[split:]:
        topic.requeue(message(seq))
    assert popped(topic) == list(range(10))


def test_gone_messages_at_the_head_are_dropped_and_those_behind_a_live_one_wait():
    topic = queue(4, 5, 6, 7)
    for seq in (1, 2, 3):
        topic.requeue(message(seq))
    for gone in (topic.back[0], topic.back[2], topic.memory[0], topic.memory[1], topic.memory[3]):
        gone.gone = True
    topic.drop_gone()
    assert [one.seq for one in topic.back] == [2, 3]
    assert [one.seq for one in topic.memory] == [6, 7]


def test_a_topic_whose_messages_are_all_gone_is_empty():
    topic = queue(2)
    topic.requeue(message(1))
    topic.back[0].gone = topic.memory[0].gone = True
    topic.drop_gone()
    assert topic.empty
