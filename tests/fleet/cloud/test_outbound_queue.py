import mqtt5
import pytest

from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.publish import publish_qos0, qos0_route
from fleet.cloud.values import CloudStats
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock

PAYLOAD = b"x" * 10
SIZE = len("a") + len(PAYLOAD)


@pytest.fixture
def stats():
    return CloudStats()


@pytest.fixture
def clock():
    return ManualClock()


def online(stats, clock, messages=3, size=10_000):
    box = OutboundQueue(Spool(SpoolSettings(messages=3), clock), messages, size, stats, clock)
    box.go_online()
    return box


@pytest.fixture
def box(stats, clock):
    return online(stats, clock)


def put(box, name, expiry=None):
    return box.put_qos0(qos0_route(name, expiry), PAYLOAD)


def durable(name):
    return Outgoing(name, PAYLOAD, 1)


def take(box, *, now=None, size=1_000_000):
    taken = box.take_qos0(now or ManualClock().monotonic(), size)
    return [message.route.topic for message in taken]


def read(taken, now):
    packets = [mqtt5.read(memoryview(publish_qos0(message, now, 5)))[0] for message in taken]
    return [(each.topic, each.message_expiry_interval) for each in packets]


def test_messages_leave_in_order_with_their_time(box, clock):
    put(box, "a")
    put(box, "b", 10.0)
    put(box, "c", 10.0)
    soon, later = clock.monotonic() + 0.9, clock.monotonic() + 1.1
    assert read(box.take_qos0(soon, SIZE + 1), soon) == [("a", None), ("b", 10)]
    assert read(box.take_qos0(later, 1_000_000), later) == [("c", 9)]
    assert take(box) == []


def test_a_full_lane_refuses_qos_0_and_counts_it(box, stats):
    for name in "abc":
        assert put(box, name)
    assert not put(box, "d")
    assert box.spool.put(durable("durable"))
    assert (stats.dropped, stats.queued) == (1, 4)


def test_bytes_bound_qos_0_too(stats, clock):
    box = online(stats, clock, messages=100, size=2 * (OVERHEAD + SIZE))
    assert [put(box, name) for name in "abc"] == [True, True, False]
    assert stats.queued_bytes == 2 * (OVERHEAD + SIZE)
    take(box)
    assert stats.queued_bytes == 0
    assert put(box, "c")


def test_without_a_connection_qos_0_is_refused_and_what_waits_is_dropped(box, stats):
    put(box, "light")
    box.spool.put(durable("lasting"))
    box.go_offline([])
    assert not put(box, "light")
    assert (stats.dropped, stats.queued, stats.queued_bytes) == (2, 1, 0)


def test_what_ran_out_of_time_is_dropped_and_never_sent(box, stats, clock):
    put(box, "old", 5.0)
    put(box, "new", 6.0)
    put(box, "ever")
    assert take(box, now=clock.monotonic() + 5.0) == ["new", "ever"]
    assert (stats.dropped, stats.queued) == (1, 0)


def test_what_was_not_acknowledged_goes_first_again_in_its_order(box):
    for name in "abc":
        box.spool.put(durable(name))
    sent = box.spool.take(1000.0, window=2, reserve=0, size=1_000_000)
    box.go_offline(sent)
    box.go_online()
    again = box.spool.take(1001.0, window=9, reserve=0, size=1_000_000)
    assert {(one.topic, one.again) for one in again} == {("a", True), ("b", True), ("c", False)}


def test_one_batch_is_bounded_in_bytes(box):
    for name in "abc":
        put(box, name)
    assert take(box, size=SIZE + 1) == ["a", "b"]
    assert take(box, size=SIZE + 1) == ["c"]


def test_a_closed_box_takes_nothing_and_keeps_nothing(box, stats):
    box.spool.put(durable("a"))
    put(box, "b")
    box.close()
    assert not box.spool.put(durable("c"))
    assert not put(box, "d")
    assert stats.queued == 0
