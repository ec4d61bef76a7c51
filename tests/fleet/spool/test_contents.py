"""Where each message of a spool is, and that the counts always agree with it."""

import pytest

from fleet.spool.contents import SpoolContents
from fleet.spool.losses import Gap, Reason
from fleet.spool.message import Outgoing
from fleet.spool.topic_queue import TopicState
from fleet.wire.rules import TrafficClass

EVENT = TrafficClass.EVENT


@pytest.fixture
def contents():
    """Return the contents of a spool with a disk and a connection."""
    return made(keeps_on_disk=True)


def made(*, keeps_on_disk):
    contents = SpoolContents(100, 10**6, keeps_on_disk=keeps_on_disk)
    contents.queues.online = True
    return contents


def add(contents, *seqs, on_disk=False, topic="t"):
    queue = contents.queues.of(topic, EVENT)
    messages = [Outgoing(topic, b"%d" % seq, 1, seq=seq, on_disk=on_disk) for seq in seqs]
    for message in messages:
        contents.add(queue, message)
    return queue, *messages


def seqs(messages):
    return [message.seq for message in messages]


def counts(contents):
    """Return how many wait, how many of them on disk only, and how many messages memory has."""
    return contents.waiting, contents.on_disk, contents.memory.count


def test_a_new_message_waits_in_memory_is_to_be_written_and_can_be_sent(contents):
    queue, message = add(contents, 7)
    assert counts(contents) == (1, 0, 1)
    assert (list(queue.memory), queue.loaded, queue.on_disk) == ([message], 7, 0)
    assert list(contents.unwritten) == [message]
    assert list(contents.queues.rings[EVENT]) == [queue]


def test_a_spool_without_a_disk_writes_nothing():
    contents = made(keeps_on_disk=False)
    _, message = add(contents, 7)
    contents.forget(message)
    assert message.gone
    assert (list(contents.unwritten), len(contents.deletions)) == ([], 0)


def test_a_message_for_the_disk_only_is_held_in_memory_until_it_is_written_but_not_sent(contents):
    queue, *_ = add(contents, 8, 9, on_disk=True)
    assert counts(contents) == (2, 2, 2)
    assert (list(queue.memory), queue.loaded, queue.on_disk, queue.oldest_on_disk) == ([], 0, 2, 8)
    assert not queue.sendable
    assert seqs(contents.unwritten) == [8, 9]
    assert contents.queues.needs_fetch == {"t": queue}


def test_the_oldest_on_disk_begins_anew_when_nothing_was_left_there(contents):
    queue, message = add(contents, 8, on_disk=True)
    contents.load(queue, message)
    add(contents, 12, on_disk=True)
    assert queue.oldest_on_disk == 12


def test_a_message_that_is_sent_waits_no_more_and_keeps_its_row(contents):
    queue, message = add(contents, 1)
    message.stored = True
    contents.take(queue, queue.pop())
    assert counts(contents) == (0, 0, 0)
    assert (queue.in_flight, message.gone, len(contents.deletions)) == (1, False, 0)


def test_a_message_that_comes_back_waits_again_before_all_others(contents):
    queue, first, _ = add(contents, 1, 2)
    contents.take(queue, queue.pop())
    contents.requeue(queue, first)
    assert counts(contents) == (2, 0, 2)
    assert (queue.back, first.again) == ([first], True)
    assert seqs(contents.memory.all()) == [1, 2]


def test_a_message_that_was_removed_while_it_was_under_way_does_not_come_back(contents):
    queue, message = add(contents, 1)
    contents.take(queue, queue.pop())
    contents.forget(message)
    contents.requeue(queue, message)
    assert counts(contents) == (0, 0, 0)
    assert queue.back == []


def test_a_written_message_that_is_forgotten_is_deleted_from_disk(contents):
    _, message = add(contents, 1)
    message.stored = True
    contents.forget(message)
    assert contents.deletions.take() == {1}


def test_a_message_that_is_forgotten_before_it_is_written_never_touches_the_disk(contents):
    _, message, other = add(contents, 1, 2)
    contents.forget(message)
    assert len(contents.deletions) == 0
    assert contents.unwritten._tombstones == 1
    assert contents.unwritten.take(0.0, at_once=True) == [other]


def test_a_lost_message_leaves_memory_and_is_told(contents):
    queue, first, second = add(contents, 1, 2)
    first.stored = True
    assert contents.lose(first, Reason.ROOM, 5.0) is queue
    assert counts(contents) == (1, 0, 1)
    assert (first.gone, list(queue.memory)) == (True, [second])
    assert contents.deletions.take() == {1}
    assert contents.losses.take() == [Gap("t", Reason.ROOM, 1, 5.0, 5.0)]
    assert contents.losses.counts == {(EVENT, Reason.ROOM): 1}


def test_a_message_for_the_disk_only_can_be_lost_before_it_is_written(contents):
    queue, message, _ = add(contents, 1, 2, on_disk=True)
    contents.lose(message, Reason.AGE, 5.0)
    assert counts(contents) == (1, 1, 1)
    assert queue.on_disk == 1


def test_a_row_is_on_disk_only_if_it_was_never_in_memory_nor_sent_nor_is_deleted(contents):
    queue, *_ = add(contents, 5)
    queue.ahead = frozenset({8})
    contents.deletions.add(7)
    found = [seq for seq in range(4, 10) if contents.is_on_disk_only(queue, seq)]
    assert found == [6, 9]
    contents.deletions.take()  # being deleted now
    assert not contents.is_on_disk_only(queue, 7)
    contents.deletions.deleted()
    assert contents.is_on_disk_only(queue, 7)


def test_a_message_that_is_loaded_is_in_memory_and_counts_there(contents):
    queue, first, _ = add(contents, 3, 4, on_disk=True)
    contents.load(queue, first)
    assert (contents.waiting, contents.on_disk) == (2, 1)
    assert (queue.on_disk, queue.loaded, queue.oldest_on_disk) == (1, 3, 3)
    assert (list(queue.memory), first.on_disk) == ([first], False)


def test_messages_that_never_reached_the_disk_are_loaded_by_topic(contents):
    queue, gone, kept = add(contents, 1, 2, on_disk=True)
    other, *_ = add(contents, 3, on_disk=True, topic="other")
    in_memory, *_ = add(contents, 4, topic="memory")
    contents.lose(gone, Reason.ROOM, 5.0)
    contents.load_unwritten({"t", "memory"})
    assert (list(queue.memory), queue.on_disk) == ([kept], 0)
    assert (list(other.memory), other.on_disk, contents.on_disk) == ([], 1, 1)
    assert seqs(in_memory.memory) == [4]


def test_messages_lost_on_disk_are_told_at_once_and_the_topic_is_looked_at_again(contents):
    queue, *_ = add(contents, 1, 2, 3, on_disk=True)
    contents.lose_on_disk(queue, 2, Reason.CORRUPT, 9.0)
    assert (contents.waiting, contents.on_disk, queue.on_disk) == (1, 1, 1)
    assert contents.losses.known() == [Gap("t", Reason.CORRUPT, 2, 9.0, 9.0)]
    contents.lose_on_disk(queue, 1, Reason.CORRUPT, 9.0)
    assert contents.queues.needs_fetch == {}
    assert queue.state is TopicState.PROBE
