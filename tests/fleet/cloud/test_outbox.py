import pytest

from fleet.cloud.outbox import Outbox
from fleet.cloud.values import CloudStats
from fleet.spool.message import OVERHEAD, Outcome, Outgoing
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock
from fleet.wire.rules import Traffic


def message(name, qos=1, **more):
    return Outgoing(name, b"x" * 10, qos, **more)


def light(name, **more):
    return message(name, 0, **more)


@pytest.fixture
def stats():
    return CloudStats()


@pytest.fixture
def box(stats):
    box = Outbox(Spool(SpoolSettings(messages=3), ManualClock()), 3, 10_000, stats)
    box.go_online()
    return box


def take(box, *, now=1000.0, window=100, reserve=0, size=1_000_000):
    return [one.topic for one in box.take(now, window=window, reserve=reserve, size=size)]


def test_replies_go_before_events_and_those_before_qos_0(box):
    for one in (light("light"), message("event"), message("reply", traffic=Traffic.REPLY)):
        assert box.put(one)
    assert take(box) == ["reply", "event", "light"]


def test_qos_1_waits_for_the_window_and_holds_qos_0_up_not_at_all(box):
    for one in (message("a"), message("b"), light("light")):
        box.put(one)
    assert take(box, window=1) == ["a", "light"]
    assert take(box, window=0) == []
    assert take(box, window=1) == ["b"]


def test_a_full_lane_refuses_qos_0_and_counts_it(box, stats):
    for name in "abc":
        assert box.put(light(name))
    assert not box.put(light("d"))
    assert box.put(message("durable"))
    assert (stats.dropped, stats.queued) == (1, 4)


def test_bytes_bound_qos_0_too(stats):
    box = Outbox(Spool(SpoolSettings(), ManualClock()), 100, 2 * (OVERHEAD + 10), stats)
    box.go_online()
    assert [box.put(light(name)) for name in "abc"] == [True, True, False]


def test_without_a_connection_qos_0_is_refused_and_what_waits_is_dropped(box, stats):
    box.put(light("light"))
    box.put(message("lasting"))
    box.go_offline([])
    assert not box.put(light("light"))
    assert [(one.topic, outcome) for one, outcome in box.take_dropped()] == [("light", Outcome.DROPPED)]
    assert (stats.dropped, stats.queued) == (2, 1)


def test_what_ran_out_of_time_is_dropped_and_never_sent(box, stats):
    for one in (light("old", deadline=5.0), light("new", deadline=6.0), light("ever")):
        box.put(one)
    assert take(box, now=5.0) == ["new", "ever"]
    assert [one.topic for one, _ in box.take_dropped()] == ["old"]
    assert stats.queued == 0


def test_what_was_not_acknowledged_goes_first_again_in_its_order(box):
    for name in "abc":
        box.put(message(name))
    sent = box.take(1000.0, window=2, reserve=0, size=1_000_000)
    box.go_offline(sent)
    box.go_online()
    again = box.take(1001.0, window=9, reserve=0, size=1_000_000)
    assert {(one.topic, one.again) for one in again} == {("a", True), ("b", True), ("c", False)}


def test_one_batch_is_bounded_in_bytes(box):
    for name in "abc":
        box.put(message(name))
    assert take(box, size=OVERHEAD + 11) == ["a", "b"]
    assert take(box, size=OVERHEAD + 11) == ["c"]


def test_a_closed_box_takes_nothing_and_gives_what_it_has_back(box):
    box.put(message("a"))
    box.put(light("b"))
    box.close()
    assert not box.put(message("c"))
    assert not box.put(light("d"))
    assert sorted(one.topic for one, _ in box.take_dropped()) == ["a", "b"]
