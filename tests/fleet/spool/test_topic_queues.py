"""Which topics can send, which need messages from disk, and which are forgotten."""

import pytest

from fleet.spool.memory_buffer import DURABLE, MemoryBuffer
from fleet.spool.message import Outgoing
from fleet.spool.topic_queue import TopicState
from fleet.spool.topic_queues import LOW, LOW_IN_NEED, TopicQueues
from fleet.wire.rules import TrafficClass

HELD, OPEN, PROBE = TopicState.HELD, TopicState.OPEN, TopicState.PROBE
REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT


@pytest.fixture
def queues():
    made = TopicQueues(MemoryBuffer(1000, 10**6))
    made.online = True
    return made


def filled(queues, topic="t", traffic=EVENT, *, memory=0, back=0, on_disk=0, state=OPEN):
    queue = queues.of(topic, traffic)
    queue.state = state
    queue.memory.extend(Outgoing(topic, b"", 1, traffic, seq=seq) for seq in range(memory))
    queue.back.extend(Outgoing(topic, b"", 1, traffic, seq=seq) for seq in range(back))
    queue.on_disk = on_disk
    return queue


def test_a_topic_has_one_queue_of_the_class_it_began_with(queues):
    queue = queues.of("t", STATUS)
    assert queues.of("t", STATUS) is queue
    assert (queue.topic, queue.traffic, queue.state, list(queues)) == ("t", STATUS, PROBE, ["t"])
    assert queues.of("u", EVENT) is not queue


def test_what_can_send_is_once_in_the_ring_of_its_class(queues):
    queue, other = filled(queues, "t", STATUS, memory=1), filled(queues, "u", EVENT, memory=1)
    for each in (queue, other, queue):
        queues.reschedule(each)
    assert [list(ring) for ring in queues.rings] == [[], [queue], [other]]
    assert len(queues.rings) == len(DURABLE)


@pytest.mark.parametrize("state", [OPEN, HELD])
def test_what_cannot_send_is_in_no_ring(queues, state):
    queue = filled(queues, memory=0 if state is OPEN else 3, state=state)
    queues.reschedule(queue)
    assert not any(queues.rings)
    assert not queue.queued


@pytest.mark.parametrize(
    ("state", "low"), [(OPEN, LOW), (PROBE, LOW), (HELD, 1)], ids=["open", "probe", "held"]
)
def test_a_topic_that_runs_low_is_fetched_from_disk_and_no_longer_when_it_has_enough(queues, state, low):
    queue = filled(queues, memory=low - 1, on_disk=5, state=state)
    queues.reschedule(queue)
    assert queues.needs_fetch == {"t": queue}
    queue.back.append(Outgoing("t", b"", 1))
    queues.reschedule(queue)
    assert queues.needs_fetch == {}


def test_a_topic_is_fetched_in_small_parts_while_memory_is_full(queues):
    for seq in range(1000):
        queues._memory.add(Outgoing("other", b"", 1, EVENT, seq=seq))
    enough = filled(queues, "enough", memory=LOW_IN_NEED, on_disk=5)
    low = filled(queues, "low", memory=LOW_IN_NEED - 1, on_disk=5)
    for queue in (enough, low):
        queues.reschedule(queue)
    assert list(queues.needs_fetch) == ["low"]


@pytest.mark.parametrize(("on_disk", "online"), [(0, True), (5, False)])
def test_nothing_is_fetched_for_a_topic_without_messages_on_disk_or_without_a_connection(
    queues, on_disk, online
):
    queue = filled(queues, on_disk=5)
    queues.reschedule(queue)
    queue.on_disk, queues.online = on_disk, online
    queues.reschedule(queue)
    assert queues.needs_fetch == {}


def test_a_spool_begins_without_a_connection():
    assert not TopicQueues(MemoryBuffer(1, 1)).online


def test_a_topic_that_has_enough_leaves_the_fetches_of_others(queues):
    other = filled(queues, "other", on_disk=1)
    queues.reschedule(other)
    queues.reschedule(filled(queues, "enough", memory=LOW, on_disk=1))
    assert queues.needs_fetch == {"other": other}


@pytest.mark.parametrize(
    ("traffic", "state", "kept"),
    [
        (EVENT, OPEN, True),
        (STATUS, OPEN, True),
        (REPLY, OPEN, False),
        (EVENT, PROBE, False),
        (EVENT, HELD, False),
        (REPLY, HELD, False),
    ],
)
def test_an_empty_topic_is_kept_while_it_is_open_but_an_inbox_is_used_once(queues, traffic, state, kept):
    queues.forget(filled(queues, "t", traffic, state=state))
    assert ("t" in queues) is kept


@pytest.mark.parametrize("left", [{"memory": 1}, {"back": 1}, {"on_disk": 1}])
def test_a_topic_with_messages_is_never_forgotten(queues, left):
    queues.forget(filled(queues, "t", REPLY, state=HELD, **left))
    assert "t" in queues


def test_a_topic_whose_last_message_is_in_flight_is_not_forgotten(queues):
    queue = filled(queues, "t", REPLY)
    queue.in_flight = 1
    queues.forget(queue)
    assert queues["t"] is queue


def test_a_forgotten_topic_leaves_every_list(queues):
    queue = filled(queues, "t", REPLY, memory=1, on_disk=1, state=PROBE)
    queues.held_topics.unsubscribed(queue, 0.0)
    queue.state = PROBE
    queues.reschedule(queue)
    assert (queue.queued, len(queues.held_topics), list(queues.needs_fetch)) == (True, 1, ["t"])
    queue.memory.clear()
    queue.on_disk = 0
    queues.forget(queue)
    assert (list(queues), queues.needs_fetch, len(queues.held_topics)) == ([], {}, 0)
    assert not any(queues.rings)
    assert not queue.queued
