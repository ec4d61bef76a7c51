"""What the disk thread is given to write, fetch and delete, and what its results change."""

import pytest

from fleet.spool.disk_exchange import FETCHED
from fleet.spool.losses import Reason
from fleet.spool.message import Outgoing
from fleet.spool.topic_queues import LOW, LOW_IN_NEED
from fleet.spool.unwritten import GRACE
from fleet.wire.rules import TrafficClass

EVENT = TrafficClass.EVENT


def seqs(messages):
    return [message.seq for message in messages]


def rows(*numbers, topic="t"):
    return [Outgoing(topic, b"", 1, seq=seq, stored=True) for seq in numbers]


def test_while_connected_only_messages_that_have_waited_are_written(exchange):
    exchange.add(1)
    exchange.add(2, since=1.0)
    assert seqs(exchange.disk.work(GRACE).rows) == [1]
    assert exchange.disk.work(GRACE).rows == []


@pytest.mark.parametrize("why", ["offline", "messages on disk only"])
def test_all_is_written_at_once_without_a_connection_or_when_messages_are_to_leave_memory(exchange, why):
    exchange.add(1, since=1.0)
    if why == "offline":
        exchange.queues.online = False
    else:
        exchange.add(2, on_disk=True, since=1.0)
    assert seqs(exchange.disk.work(0.0).rows)[0] == 1


def test_there_is_work_until_a_change_is_on_disk(exchange):
    assert (exchange.disk.unwritten, exchange.disk.failing) == (False, False)
    exchange.add(1)
    assert exchange.disk.unwritten
    work = exchange.disk.work(GRACE)
    assert exchange.disk.unwritten
    exchange.disk.wrote(work)
    assert not exchange.disk.unwritten


def test_a_row_to_delete_is_work_until_it_is_deleted(exchange):
    (message,) = exchange.add(1)
    exchange.written()
    exchange.contents.forget(message)
    assert exchange.disk.unwritten
    work = exchange.disk.work(GRACE)
    assert (list(work.rows), set(work.done), exchange.disk.unwritten) == ([], {1}, True)
    exchange.disk.wrote(work)
    assert (exchange.disk.unwritten, 1 in exchange.contents.deletions) == (False, False)


def test_a_loss_to_record_is_work(exchange):
    exchange.contents.losses.note("t", EVENT, Reason.AGE, 0.0)
    assert exchange.disk.unwritten


def test_looking_for_work_in_vain_leaves_none_behind(exchange):
    exchange.add(1, since=1.0)
    exchange.disk.work(0.0)
    exchange.contents.unwritten.take(0.0, at_once=True)
    assert not exchange.disk.unwritten


def test_messages_that_are_on_disk_only_leave_memory_once_they_are_written_the_others_stay(exchange):
    exchange.add(1)
    (cold,) = exchange.add(2, on_disk=True)
    assert exchange.counts == (2, 1, 2)
    exchange.written()
    assert exchange.counts == (2, 1, 1)
    assert cold.gone


def test_a_message_that_was_loaded_while_it_was_written_stays_in_memory(exchange):
    (cold,) = exchange.add(2, on_disk=True)
    work = exchange.disk.work(0.0)
    exchange.contents.load(exchange.queues["t"], cold)
    exchange.disk.wrote(work)
    assert (exchange.counts, cold.gone) == ((1, 0, 1), False)


def test_changes_that_failed_are_tried_again_and_the_disk_counts_as_failing(exchange):
    deleted, message = exchange.add(1, 2)
    exchange.contents.unwritten.take(GRACE, at_once=True)
    exchange.contents.forget(deleted)
    exchange.contents.unwritten.requeue([message])
    work = exchange.disk.work(GRACE)
    exchange.disk.not_written(work)
    assert (exchange.disk.failing, message.stored) == (True, False)
    again = exchange.disk.work(GRACE)
    assert (seqs(again.rows), set(again.done)) == ([2], {1})
    exchange.disk.wrote(again)
    assert (exchange.disk.failing, exchange.disk.unwritten) == (False, False)


def test_a_failed_change_without_anything_left_to_write_is_no_work(exchange):
    (message,) = exchange.add(1)
    work = exchange.disk.work(GRACE)
    message.gone = True
    exchange.disk.not_written(work)
    assert not exchange.disk.unwritten


# -- fetches -----------------------------------------------------------------------------------------


def test_a_fetch_asks_for_what_follows_the_newest_in_memory(exchange):
    exchange.add(3)
    exchange.add(4, on_disk=True)
    (fetch,) = exchange.disk.fetches()
    assert (fetch.topic, fetch.traffic, fetch.after, fetch.limit) == ("t", EVENT, 3, FETCHED)
    assert exchange.disk.needs_fetch


@pytest.mark.parametrize(
    ("room", "limit"),
    [
        (1000, FETCHED),
        (2 * FETCHED - 2, FETCHED - 1),
        (101, 50),
        (2 * LOW_IN_NEED + 2, LOW_IN_NEED + 1),
        (0, LOW_IN_NEED),
    ],
)
def test_topics_share_the_room_in_memory_and_each_gets_a_few_when_there_is_none(exchange, room, limit):
    for topic in ("a", "b"):
        exchange.queues.of(topic, EVENT).on_disk = 1
        exchange.queues.reschedule(exchange.queues[topic])
    exchange.add(*range(exchange.contents.memory.room - room), topic="other")
    assert [fetch.limit for fetch in exchange.disk.fetches()] == [limit, limit]


def test_a_single_topic_has_all_of_the_room(exchange):
    exchange.add(*range(900), topic="other")
    exchange.queues.of("t", EVENT).on_disk = 1
    exchange.queues.reschedule(exchange.queues["t"])
    assert [fetch.limit for fetch in exchange.disk.fetches()] == [100]


def test_nothing_is_fetched_for_nobody(exchange):
    exchange.add(1)
    assert (exchange.disk.fetches(), exchange.disk.needs_fetch) == ([], False)


def test_what_was_fetched_is_in_memory_and_may_be_sent(exchange):
    exchange.disk.found("t", EVENT, 2, 5, 6)
    exchange.disk.fetched("t", rows(5, 6), more=False)
    assert exchange.counts == (2, 0, 2)
    assert seqs(exchange.queues["t"].memory) == [5, 6]
    assert list(exchange.queues.rings[EVENT]) == [exchange.queues["t"]]
    assert not exchange.disk.needs_fetch


def test_a_part_that_was_fetched_is_followed_by_the_next(exchange):
    exchange.disk.found("t", EVENT, 3, 5, 7)
    exchange.disk.fetched("t", rows(5), more=True)
    assert (exchange.counts[1], exchange.disk.fetches()[0].after) == (2, 5)


def test_rows_that_are_not_needed_are_skipped_and_the_next_fetch_continues_behind_them(exchange):
    exchange.disk.found("t", EVENT, 3, 5, 7)
    exchange.contents.deletions.add(5)
    exchange.contents.deletions.add(6)
    exchange.disk.fetched("t", rows(5, 6), more=True)
    assert exchange.disk.fetches()[0].after == 6
    assert (list(exchange.queues["t"].memory), exchange.counts) == ([], (3, 3, 0))


def test_an_older_fetch_does_not_turn_back_the_next_one(exchange):
    exchange.disk.found("t", EVENT, 2, 5, 9)
    exchange.queues["t"].loaded = 8
    exchange.disk.fetched("t", rows(7), more=True)
    assert exchange.queues["t"].loaded == 8


def test_messages_that_never_reached_the_disk_follow_the_last_fetch_alone(exchange):
    exchange.disk.found("t", EVENT, 2, 5, 6)
    exchange.add(7, on_disk=True)
    exchange.disk.fetched("t", rows(5), more=True)
    assert seqs(exchange.queues["t"].memory) == [5]
    exchange.disk.fetched("t", rows(6), more=False)
    assert (seqs(exchange.queues["t"].memory), exchange.counts) == ([5, 6, 7], (3, 0, 3))


def test_what_comes_for_a_topic_that_needs_nothing_any_more_is_ignored(exchange):
    exchange.disk.found("t", EVENT, 1, 5, 5)
    exchange.queues.online = False
    exchange.queues.needs_fetch.clear()
    exchange.disk.fetched("t", rows(5), more=False)
    exchange.disk.fetched("unknown", rows(5, topic="unknown"), more=False)
    assert (exchange.counts, list(exchange.queues)) == ((1, 1, 0), ["t"])


def test_a_topic_whose_rows_are_gone_without_a_trace_is_fetched_until_it_is_full(exchange):
    exchange.disk.found("t", EVENT, LOW + 1, 1, LOW + 1)
    exchange.disk.fetched("t", rows(*range(1, LOW + 1)), more=True)
    assert (exchange.disk.needs_fetch, exchange.counts[1]) == (False, 1)
