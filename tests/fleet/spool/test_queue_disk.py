"""What the queue has written, and brings back, with a disk that is a dictionary and sometimes fails."""

import pytest

from fleet.spool.losses import Reason
from fleet.spool.message import DeliveryOutcome
from fleet.spool.topic_queues import LOW_IN_NEED
from fleet.spool.unwritten import GRACE
from fleet.wire.rules import TrafficClass

REPLY, EVENT = TrafficClass.REPLY, TrafficClass.EVENT


def numbers(first, end):
    return [b"%d" % number for number in range(first, end)]


def test_what_is_taken_in_time_never_touches_the_disk(make_bench):
    bench = make_bench().online()
    bench.put()
    assert bench.send() == [b"0"]
    bench.now += 2 * GRACE
    work = bench.queue.disk.work(bench.now)
    assert (list(work.rows), list(work.done)) == ([], [])


def test_what_is_not_taken_in_time_goes_to_disk_and_leaves_it_when_it_is_taken(make_bench):
    bench = make_bench().online()
    bench.put()
    bench.disk()
    assert bench.rows == {}
    bench.now += GRACE
    bench.disk()
    assert len(bench.rows) == 1
    assert bench.send() == [b"0"]
    bench.disk()
    assert bench.rows == {}


def test_without_a_connection_everything_goes_to_disk_at_once(make_bench):
    bench = make_bench()
    bench.put()
    bench.disk()
    assert len(bench.rows) == 1


def test_beyond_the_memory_it_waits_on_disk_alone_and_comes_back_in_order(make_bench):
    bench = make_bench(messages=5)
    for _ in range(30):
        bench.put()
        bench.disk()
    assert (bench.queue.on_disk, bench.queue.waiting) == (25, 30)
    bench.online()
    assert bench.drain() == numbers(0, 30)
    assert (bench.queue.on_disk, bench.queue.waiting, bench.rows) == (0, 0, {})


def test_a_new_process_sends_what_the_old_one_left_before_its_own(make_bench):
    bench = make_bench()
    for _ in range(10):
        bench.put()
    bench.disk()
    bench = bench.restarted()
    bench.put()
    assert bench.online().drain() == numbers(0, 11)


def test_what_was_lost_before_the_disk_could_be_read_is_not_counted_with_what_is_on_it(make_bench):
    bench = make_bench()
    for _ in range(4):
        bench.put()
    bench.disk()
    bench.queue.disk.removed("t", [sorted(bench.rows)[1]], Reason.ROOM, bench.wall)
    bench.queue.disk.found("t", EVENT, 2, 1, 2)
    assert (bench.queue.on_disk, bench.queue.waiting) == (5, 5)


def test_what_was_under_way_when_the_disk_could_be_read_at_last_is_not_fetched_from_it(make_bench):
    bench = make_bench()
    for _ in range(3):
        bench.put()
    bench.disk()
    bench = bench.restarted(there=False).online()
    bench.put()
    bench.put()
    flying = bench.take()
    bench.look(there=True)
    bench.disk()
    bench.queue.settle(flying[0], DeliveryOutcome.ACKED, bench.now, bench.wall)
    assert bench.drain() == [*numbers(0, 3), b"4"]
    assert (bench.queue.on_disk, bench.queue.waiting, bench.rows) == (0, 0, {})


def test_a_full_disk_bounds_memory_and_loses_nothing_within_the_bound(make_bench):
    bench = make_bench(messages=5)
    for _ in range(5):
        bench.put()
    bench.disk(works=False)
    bench.put()
    assert bench.queue.losses.total == 1
    bench.online()
    assert bench.drain() == numbers(1, 6)


def test_what_was_cold_when_the_disk_failed_still_comes_in_order(make_bench):
    bench = make_bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.disk()
    bench.online()
    sent = bench.send() + bench.send()
    bench.disk(works=False)
    bench.put()
    bench.put()
    for _ in range(10):
        sent += bench.send()
        bench.fetch()
    assert sent == numbers(0, 10)


def test_a_damaged_file_costs_what_was_on_it_alone_and_is_counted(make_bench):
    bench = make_bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.disk()
    bench.queue.disk.lost_disk(bench.wall)
    bench.rows.clear()
    assert [(gap.reason, gap.lost) for gap in bench.queue.losses.take()] == [(Reason.CORRUPT, 3)]
    bench.disk()
    assert len(bench.rows) == 5
    assert bench.online().drain() == numbers(0, 5)


def test_what_was_cold_when_the_disk_went_away_is_sent_in_order_and_more_follows(make_bench):
    bench = make_bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.online().queue.disk.disk_missing()
    assert bench.queue.on_disk == 0
    bench.put()
    sent = bench.drain()
    bench.put()
    assert [*sent, *bench.send()] == numbers(9 - 5, 10)
    assert bench.queue.losses.total == 4


def test_what_is_evicted_from_disk_is_lost_unless_it_is_under_way(make_bench):
    bench = make_bench(messages=5)
    for _ in range(8):
        bench.put()
    bench.disk()
    flying = bench.online().take()
    removed = [bench.rows.pop(seq).seq for seq in sorted(bench.rows)[:6]]
    bench.queue.disk.removed("t", removed, Reason.ROOM, bench.wall)
    assert [(gap.reason, gap.lost) for gap in bench.queue.losses.take()] == [(Reason.ROOM, 5)]
    bench.queue.settle(flying[0], DeliveryOutcome.ACKED, bench.now, bench.wall)
    assert bench.drain() == numbers(6, 8)


def test_what_is_pushed_out_while_the_disk_writes_it_is_lost_and_not_sent(make_bench):
    bench = make_bench(messages=2)
    for _ in range(4):
        bench.put()
    work = bench.queue.disk.work(bench.now)
    for _ in range(4):
        bench.put()
    assert bench.queue.losses.total == 4
    bench.online().commit(work)
    bench.fetch()
    assert bench.drain() == numbers(4, 8)
    assert (bench.queue.on_disk, bench.queue.waiting, bench.queue.disk.needs_fetch) == (0, 0, False)


@pytest.fixture
def begun_anew(make_bench):
    """Give a bench whose topic was answered, is begun anew, and whose old rows are still on disk."""
    bench = make_bench(messages=2)
    for _ in range(2):
        bench.put("inbox", REPLY)
    bench.disk()
    bench.online().send()
    assert bench.send() == numbers(1, 2)
    for topic in ("other", "other", "inbox"):
        bench.put(topic, REPLY)
    assert len(bench.rows) == 2
    return bench


def test_what_was_acknowledged_is_not_fetched_again_before_it_is_deleted(begun_anew):
    begun_anew.fetch()
    assert begun_anew.queue.on_disk == 0
    assert sorted(begun_anew.drain()) == numbers(2, 5)
    assert (begun_anew.queue.on_disk, begun_anew.queue.waiting, begun_anew.rows) == (0, 0, {})


def test_what_was_acknowledged_is_no_loss_when_it_is_evicted_while_it_is_deleted(begun_anew):
    work = begun_anew.queue.disk.work(begun_anew.now)
    begun_anew.evict(2)
    begun_anew.commit(work)
    assert (begun_anew.queue.losses.total, begun_anew.queue.on_disk) == (0, 1)
    assert sorted(begun_anew.drain()) == numbers(2, 5)


def test_rows_that_cannot_be_deleted_do_not_hide_those_behind_them(make_bench):
    bench = make_bench(messages=2)
    for _ in range(3 * LOW_IN_NEED):
        bench.put("inbox", REPLY)
        bench.disk()
    bench.online()
    while bench.send():
        bench.fetch()
    for topic in ("other", "other", "inbox"):
        bench.put(topic, REPLY)
    for _ in range(4):
        bench.fetch()
    assert bench.queue.on_disk == 0
