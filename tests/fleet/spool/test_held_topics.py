"""When a topic without a subscriber is tried again."""

import pytest

from fleet.spool.held_topics import HeldTopics
from fleet.spool.message import Outgoing
from fleet.spool.topic_queue import TopicQueue, TopicState
from fleet.wire.rules import TrafficClass

HELD, OPEN, PROBE = TopicState.HELD, TopicState.OPEN, TopicState.PROBE


def queue(topic="t", state=PROBE):
    made = TopicQueue(topic, TrafficClass.EVENT)
    made.state = state
    return made


@pytest.fixture
def held():
    return HeldTopics()


@pytest.mark.parametrize("state", [PROBE, OPEN])
def test_a_topic_that_nobody_hears_is_held_for_a_second(held, state):
    deaf = queue(state=state)
    held.unsubscribed(deaf, 100.0)
    assert (deaf.state, deaf.retry, len(held)) == (HELD, 101.0, 1)
    assert held.due(100.999) == []
    assert held.due(101.0) == [deaf]
    assert (deaf.state, len(held)) == (PROBE, 0)


def test_the_wait_doubles_with_each_attempt_up_to_a_quarter_of_a_minute(held):
    deaf, waits = queue(), []
    for _ in range(12):
        held.unsubscribed(deaf, 0.0)
        waits.append(deaf.retry)
        held.due(deaf.retry)
    assert waits == [1, 2, 4, 8, *[15] * 8]


def test_further_messages_in_flight_that_nobody_hears_do_not_lengthen_the_wait(held):
    deaf = queue()
    for now in (0.0, 0.5, 0.9):
        held.unsubscribed(deaf, now)
    assert (deaf.retry, deaf.unsubscribed, len(held)) == (1.0, 1, 1)


def test_only_the_topics_that_are_due_are_tried(held):
    early, later = queue("early"), queue("later")
    held.unsubscribed(early, 0.0)
    held.unsubscribed(later, 0.5)
    assert held.due(1.0) == [early]
    assert (early.state, later.state, len(held)) == (PROBE, HELD, 1)
    assert held.due(1.5) == [later]


def test_a_topic_that_is_heard_again_has_all_others_tried_at_once(held):
    first, second = queue("first"), queue("second")
    for _ in range(3):
        held.unsubscribed(first, 0.0)
        held.unsubscribed(second, 0.0)
        held.due(60.0)
    held.unsubscribed(second, 60.0)
    held.record_subscriber(first, 61.0)
    assert (first.state, first.unsubscribed, second.retry) == (OPEN, 0, 61.0)
    assert held.due(61.0) == [second]
    held.unsubscribed(first, 62.0)
    assert first.retry == 63.0


def test_a_topic_that_was_heard_all_along_says_nothing_about_others(held):
    deaf, new, known = queue("deaf"), queue("new"), queue("known", OPEN)
    held.unsubscribed(deaf, 0.0)
    held.record_subscriber(new, 0.1)
    held.record_subscriber(known, 0.1)
    assert (new.state, known.state, deaf.retry) == (OPEN, OPEN, 1.0)


def test_an_answer_for_a_held_topic_leads_to_a_probe_not_to_a_burst(held):
    """Its other messages in flight may still come back."""
    deaf = queue()
    held.unsubscribed(deaf, 0.0)
    held.record_subscriber(deaf, 0.1)
    assert deaf.state is PROBE
    assert held.due(0.1) == [deaf]
    assert deaf.state is PROBE


def test_the_messages_of_all_held_topics_are_counted(held):
    for topic, count in (("a", 2), ("b", 1)):
        deaf = queue(topic)
        deaf.memory.extend(Outgoing(topic, b"", 1) for _ in range(count))
        deaf.on_disk = 10
        held.unsubscribed(deaf, 0.0)
    assert held.messages == 23


def test_a_topic_that_is_forgotten_is_not_tried(held):
    deaf, other = queue("deaf"), queue("other")
    held.unsubscribed(deaf, 0.0)
    held.forget(deaf)
    held.forget(other)
    assert (len(held), held.messages, held.due(60.0)) == (0, 0, [])


def test_nothing_is_held_after_it_is_cleared(held):
    held.unsubscribed(queue(), 0.0)
    held.clear()
    assert held.due(60.0) == []
