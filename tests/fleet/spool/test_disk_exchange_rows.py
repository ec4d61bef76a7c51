"""What becomes of the messages whose rows were found on disk, were removed from it, or went with the file."""

import pytest

from fleet.spool.losses import Gap, Reason
from fleet.spool.topic_queue import TopicState
from fleet.wire.rules import TrafficClass

EVENT, STATUS = TrafficClass.EVENT, TrafficClass.STATUS
NOW = 9.0


def seqs(messages):
    return [message.seq for message in messages]


def gaps(exchange):
    return [(gap.topic, gap.reason, gap.lost) for gap in exchange.contents.losses.known()]


# -- found -------------------------------------------------------------------------------------------


def test_what_an_earlier_process_left_waits_on_disk_and_later_numbers_are_higher(exchange):
    exchange.disk.found("t", STATUS, 3, 5, 9)
    exchange.disk.found("u", EVENT, 1, 2, 2)
    assert exchange.counts == (4, 4, 0)
    queue = exchange.queues["t"]
    assert (queue.traffic, queue.on_disk, queue.oldest_on_disk, queue.loaded) == (STATUS, 3, 5, 0)
    assert exchange.disk.before == 9
    assert list(exchange.queues.needs_fetch) == ["t", "u"]


def test_messages_queued_before_the_disk_could_be_read_follow_what_is_found(exchange):
    mine = exchange.add(20, 21)
    exchange.contents.lose(mine[0], Reason.AGE, NOW)
    exchange.disk.found("t", EVENT, 2, 5, 6)
    queue = exchange.queues["t"]
    assert (exchange.counts, queue.on_disk, list(queue.memory)) == ((3, 3, 1), 3, [])
    assert mine[1].on_disk
    assert queue.ahead == frozenset()


def test_messages_that_are_under_way_when_the_disk_is_read_are_not_fetched_again(exchange):
    _, _, done, other = (*exchange.add(20, 21, 22), *exchange.add(23, topic="other"))
    done.gone = True
    flying = exchange.fly()
    exchange.disk.found("t", EVENT, 1, 5, 5)
    assert exchange.queues["t"].ahead == {flying.seq}
    assert exchange.queues["t"].loaded == 0
    assert not exchange.contents.is_on_disk_only(exchange.queues["t"], flying.seq)
    assert exchange.contents.is_on_disk_only(exchange.queues["t"], 21)
    assert other.on_disk is False


# -- removed -----------------------------------------------------------------------------------------


def test_removed_rows_are_lost_wherever_their_messages_wait(exchange):
    exchange.add(1, 2)
    exchange.written()
    exchange.add(3, 4, 5, on_disk=True)
    exchange.written()
    exchange.disk.removed("t", [1, 3, 4], Reason.ROOM, NOW)
    assert gaps(exchange) == [("t", Reason.ROOM, 3)]
    assert exchange.contents.losses.known()[0].until == NOW
    assert exchange.counts == (2, 1, 1)
    assert (seqs(exchange.queues["t"].memory), exchange.queues["t"].oldest_on_disk) == ([2], 4)


def test_a_removed_row_whose_message_came_back_is_lost(exchange):
    exchange.add(1, 2)
    exchange.written()
    flying = exchange.fly()
    exchange.queues["t"].in_flight -= 1
    exchange.contents.requeue(exchange.queues["t"], flying)
    exchange.disk.removed("t", [1], Reason.AGE, NOW)
    assert (exchange.queues["t"].back, gaps(exchange)) == ([], [("t", Reason.AGE, 1)])


def test_a_removed_row_is_no_loss_while_its_message_is_under_way(exchange):
    exchange.add(1, 2)
    exchange.written()
    flying = exchange.fly()
    exchange.disk.removed("t", [1], Reason.ROOM, NOW)
    assert (gaps(exchange), flying.gone, exchange.counts) == ([], False, (1, 0, 1))
    exchange.disk.removed("t", [1, 2], Reason.ROOM, NOW)
    assert gaps(exchange) == [("t", Reason.ROOM, 1)]


def test_the_oldest_on_disk_never_becomes_older(exchange):
    exchange.disk.found("t", EVENT, 4, 5, 9)
    exchange.queues["t"].oldest_on_disk = 8
    exchange.disk.removed("t", [6, 7], Reason.ROOM, NOW)
    assert exchange.queues["t"].oldest_on_disk == 8


def test_the_last_removed_row_of_a_topic_ends_the_topic(exchange):
    exchange.disk.found("t", EVENT, 1, 5, 5)
    exchange.disk.removed("t", [5], Reason.AGE, NOW)
    assert (list(exchange.queues), exchange.counts) == ([], (0, 0, 0))


def test_rows_of_a_topic_that_is_forgotten_are_no_loss(exchange):
    exchange.disk.removed("t", [5], Reason.AGE, NOW)
    assert (gaps(exchange), list(exchange.queues)) == ([], [])


def test_a_topic_that_still_has_rows_after_its_last_fetch_is_kept(exchange):
    exchange.disk.found("t", EVENT, 2, 5, 6)
    exchange.disk.fetched("t", [], more=True)
    assert exchange.disk.needs_fetch
    exchange.contents.lose_on_disk(exchange.queues["t"], 2, Reason.AGE, NOW)
    exchange.queues.needs_fetch["t"] = exchange.queues["t"]
    exchange.disk.fetched("t", [], more=False)
    assert list(exchange.queues) == []


# -- the file is lost, or missing --------------------------------------------------------------------


def test_with_the_file_only_what_was_not_in_memory_is_lost(exchange):
    exchange.add(1, 2)
    exchange.written()
    exchange.add(3, 4, on_disk=True)
    exchange.written()
    exchange.add(5, 6, on_disk=True)
    exchange.disk.lost_disk(NOW)
    assert exchange.contents.losses.known() == [Gap("t", Reason.CORRUPT, 2, NOW, NOW)]
    assert exchange.counts == (4, 2, 4)
    work = exchange.written()
    assert sorted(seqs(work.rows)) == [1, 2, 5, 6]


def test_messages_that_came_back_are_written_to_the_new_file_too(exchange):
    exchange.add(1, 2)
    exchange.written()
    flying = exchange.fly()
    exchange.contents.requeue(exchange.queues["t"], flying)
    gone = exchange.queues["t"].memory[0]
    gone.gone = True
    exchange.disk.lost_disk(NOW)
    assert seqs(exchange.contents.unwritten) == [1]
    assert not flying.stored


def test_messages_of_other_topics_do_not_count_for_a_topic_that_lost_all(exchange):
    exchange.disk.found("t", EVENT, 2, 5, 6)
    *_, gone = exchange.add(7, 8, 9, topic="other", on_disk=True)
    exchange.contents.lose(gone, Reason.ROOM, NOW)
    exchange.disk.lost_disk(NOW)
    assert ("t", Reason.CORRUPT, 2) in gaps(exchange)
    assert list(exchange.queues) == ["other"]
    assert exchange.queues["other"].on_disk == 2


def test_the_file_takes_its_deletions_with_it(exchange):
    (message,) = exchange.add(1)
    exchange.written()
    exchange.contents.forget(message)
    exchange.disk.lost_disk(NOW)
    assert not exchange.disk.unwritten


@pytest.mark.parametrize("on_disk", [True, False])
def test_without_a_file_all_stays_in_memory_and_can_be_sent(exchange, on_disk):
    exchange.add(1, 2, on_disk=on_disk)
    exchange.disk.disk_missing()
    assert exchange.disk.failing
    assert (exchange.counts, seqs(exchange.queues["t"].memory)) == ((2, 0, 2), [1, 2])
    assert list(exchange.queues.rings[EVENT]) == [exchange.queues["t"]]
    assert exchange.queues["t"].state is TopicState.PROBE
    assert not exchange.disk.needs_fetch
