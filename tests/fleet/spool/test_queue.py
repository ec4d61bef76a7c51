"""What the queue sends next, what it holds, and what it drops: order, window, ages, bounds."""

from itertools import pairwise

import pytest

from fleet.spool.losses import Reason
from fleet.spool.message import OVERHEAD, DeliveryOutcome
from fleet.spool.queue import NEWEST_FIRST
from fleet.spool.spool import AGES
from fleet.wire.rules import TrafficClass

REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT


def numbers(first, end):
    return [b"%d" % number for number in range(first, end)]


def test_replies_go_before_status_and_events_wait_for_both(make_bench):
    bench = make_bench(messages=100).online()
    for topic, traffic in (("e", EVENT), ("s", STATUS), ("r", REPLY)):
        bench.put(topic, traffic)
    assert [message.topic for message in bench.take()] == ["r", "s", "e"]


def test_the_end_of_the_window_is_for_replies(make_bench):
    bench = make_bench(messages=100).online()
    for number in range(10):
        bench.put(f"e{number}")
        bench.put(f"r{number}", REPLY)
    taken = bench.take(window=12, reserve=2)
    assert [message.traffic for message in taken] == [REPLY] * 10


def test_the_newest_state_goes_before_what_has_waited_but_replies_do_not_wait_for_it(make_bench):
    bench = make_bench()
    bench.put("e")
    bench.put("r", REPLY)
    bench.queue.go_online(bench.now)
    assert [message.topic for message in bench.take()] == ["r"]
    bench.now += NEWEST_FIRST
    assert [message.topic for message in bench.take()] == ["e"]


def test_a_topic_that_nobody_hears_is_tried_again_ever_more_slowly_and_others_go_on(make_bench):
    bench = make_bench(messages=100).online()
    bench.put("deaf")
    tried = []
    for _ in range(600):
        tried += [bench.now] * len(bench.send(outcome=DeliveryOutcome.HELD))
        bench.now += 0.1
        bench.queue.tick(bench.now, bench.wall)
    waits = [round(after - before) for before, after in pairwise(tried)]
    assert waits == [1, 2, 4, 8, 15, 15]
    bench.put("heard")
    assert b"1" in bench.send()


def test_what_waits_for_somebody_to_hear_it_is_counted_apart(make_bench):
    bench = make_bench(messages=100).online()
    for topic in ("deaf", "deaf", "deaf", "heard"):
        bench.put(topic)
    deaf, heard = bench.take()
    bench.queue.settle(deaf, DeliveryOutcome.HELD, bench.now, bench.wall)
    assert (bench.queue.waiting, bench.queue.unsubscribed) == (3, 3)
    bench.queue.settle(heard, DeliveryOutcome.ACKED, bench.now, bench.wall)
    bench.now += 60.0
    bench.queue.tick(bench.now, bench.wall)
    bench.queue.settle(bench.take()[0], DeliveryOutcome.ACKED, bench.now, bench.wall)
    assert (bench.queue.waiting, bench.queue.unsubscribed) == (2, 0)


def test_somebody_who_comes_back_hears_all_topics_at_once(make_bench):
    bench = make_bench(messages=100).online()
    for topic in "ab":
        bench.put(topic)
    for _ in range(6):
        bench.send(outcome=DeliveryOutcome.HELD)
        bench.now += 20.0
        bench.queue.tick(bench.now, bench.wall)
    first = bench.take(window=1)
    assert bench.queue.held == 0
    bench.queue.settle(first[0], DeliveryOutcome.HELD, bench.now, bench.wall)
    (second,) = bench.take()
    bench.queue.settle(second, DeliveryOutcome.ACKED, bench.now, bench.wall)
    bench.queue.tick(bench.now, bench.wall)
    assert [message.topic for message in bench.take()] == [first[0].topic]


def test_one_message_asks_whether_anybody_hears_and_the_rest_follows(make_bench):
    bench = make_bench(messages=100).online()
    for _ in range(10):
        bench.put()
    assert len(bench.take()) == 1
    bench.queue.go_offline()


@pytest.mark.parametrize(("traffic", "age"), AGES.items())
def test_what_is_too_old_is_dropped_and_counted(make_bench, traffic, age):
    bench = make_bench(messages=100).online()
    bench.put("t", traffic)
    bench.now += age
    bench.queue.tick(bench.now, bench.wall)
    assert bench.take() == []
    (gap,) = bench.queue.losses.take()
    assert (gap.topic, gap.reason, gap.lost) == ("t", Reason.AGE, 1)


def test_a_message_may_be_worth_less_time_but_not_more(make_bench):
    bench = make_bench(messages=100).online()
    bench.put("short", expiry=5.0)
    bench.put("long", REPLY, expiry=10**6)
    bench.now += 5.0
    assert [message.topic for message in bench.take()] == ["long"]
    assert bench.queue.losses.total == 1


def test_without_a_disk_the_oldest_of_what_matters_least_is_pushed_out(make_bench):
    bench = make_bench(messages=4, disk=False)
    for topic, traffic in (("s", STATUS), ("e", EVENT), ("r", REPLY), ("e", EVENT), ("r", REPLY)):
        assert bench.put(topic, traffic)
    assert bench.put("s", STATUS)
    assert not bench.put("huge", EVENT, b"x" * 10**7)
    lost = {(gap.topic, gap.lost) for gap in bench.queue.losses.take()}
    assert lost == {("e", 2), ("huge", 1)}
    bench.online()
    assert sorted(message.topic for message in bench.take()) == ["r", "s"]


def test_what_matters_less_never_pushes_out_what_matters_more(make_bench):
    bench = make_bench(messages=2, disk=False)
    assert bench.put("r", REPLY)
    assert bench.put("r", REPLY)
    assert not bench.put("e", EVENT)


@pytest.mark.parametrize("disk", [True, False])
def test_a_message_that_can_never_fit_pushes_nothing_out(make_bench, disk):
    size = 10 * OVERHEAD
    bench = make_bench(messages=100, size=size, disk=disk)
    for topic, traffic in (("r", REPLY), ("r", REPLY), ("e", EVENT)):
        bench.put(topic, traffic)
    for traffic, too_large in ((REPLY, 2 * size), (EVENT, 2 * size - 2 * OVERHEAD)):
        assert not bench.put("huge", traffic, bytes(too_large))
    assert bench.queue.waiting == 3
    assert {(gap.topic, gap.lost) for gap in bench.queue.losses.take()} == {("huge", 2)}


def test_a_refused_message_is_lost_and_counted_and_the_next_goes(make_bench):
    bench = make_bench(messages=100).online()
    bench.put()
    bench.put()
    assert bench.send(outcome=DeliveryOutcome.REFUSED) == [b"0"]
    assert bench.send() == [b"1"]
    assert bench.queue.losses.total == 1


def test_an_inbox_that_was_answered_is_forgotten(make_bench):
    bench = make_bench(messages=100).online()
    for number in range(50):
        bench.put(f"inbox/{number}", REPLY)
    bench.send()
    assert bench.queue._queues == {}
    bench.put("gone", REPLY)
    bench.send(outcome=DeliveryOutcome.HELD)
    bench.now += AGES[REPLY]
    bench.queue.tick(bench.now, bench.wall)
    bench.take()
    assert bench.queue._queues == {}
    assert bench.queue.idle


def test_inboxes_whose_answers_grew_too_old_are_forgotten_also_without_a_connection(make_bench):
    bench = make_bench(messages=100)
    for number in range(50):
        bench.put(f"inbox/{number}", REPLY)
    bench.now += AGES[REPLY]
    bench.queue.tick(bench.now, bench.wall)
    assert bench.queue._queues == {}
    assert bench.queue.idle


def test_topics_that_were_pushed_out_are_forgotten_and_can_begin_anew(make_bench):
    bench = make_bench(messages=1, disk=False)
    for topic in "abcab":
        assert bench.put(topic)
    assert list(bench.queue._queues) == ["b"]
    assert bench.online().drain() == numbers(4, 5)
    assert bench.queue.idle


def test_a_message_that_is_refused_leaves_no_topic_behind(make_bench):
    bench = make_bench(disk=False)
    assert not bench.put("huge", EVENT, b"x" * 10**7)
    assert bench.queue._queues == {}


@pytest.mark.parametrize("disk", [True, False])
def test_what_was_pushed_out_is_not_kept_in_memory(make_bench, disk):
    bench = make_bench(messages=5, disk=disk)
    bench.disk(works=False)
    for _ in range(100):
        bench.put()
    assert bench.queue.losses.total == 95
    assert len(bench.queue._queues["t"].memory) == 5


def test_what_came_back_and_was_pushed_out_is_not_kept_in_memory(make_bench):
    bench = make_bench(messages=5, disk=False).online()
    for _ in range(5):
        bench.put()
    bench.send()
    bench.queue.requeue(bench.take())
    for _ in range(4):
        bench.put()
    assert [message.payload for message in bench.queue._queues["t"].back] == [b"4"]


def test_memory_holds_no_more_than_its_bound_for_each_kind_of_bound(make_bench):
    bench = make_bench(messages=100, size=3 * (OVERHEAD + 10), disk=False)
    for _ in range(10):
        assert bench.put(payload=b"x" * 10)
    assert bench.queue.waiting == 3
