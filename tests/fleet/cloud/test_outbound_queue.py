import mqtt5
import pytest

from fleet.cloud.outbound_queue import OutboundQueue
from fleet.cloud.publish import publish_light, publish_route
from fleet.cloud.values import CloudStats
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.spool.spool import Spool, SpoolSettings
from fleet.testing.clock import ManualClock

PAYLOAD = b"x" * 10
PACKET = len(publish_light(publish_route("a", None, 5), PAYLOAD))


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
    return box.put_light([box.address(name, expiry, 5)], [PAYLOAD])


def durable(name):
    return Outgoing(name, PAYLOAD, 1)


def take(box, *, now=None, size=1_000_000):
    taken = box.take_light(now or ManualClock().monotonic(), size)
    return [where.topic for light_batch in taken for where in light_batch.where]


def read(taken):
    told = [mqtt5.read(packet)[0] for light_batch in taken for packet in light_batch.packets]
    return [(each.topic, each.message_expiry_interval) for each in told]


def test_messages_leave_in_order_with_their_time(box, clock):
    put(box, "a")
    put(box, "b", 10.0)
    put(box, "c", 10.0)
    assert read(box.take_light(clock.monotonic() + 0.9, PACKET + 5)) == [("a", None), ("b", 10)]
    assert read(box.take_light(clock.monotonic() + 1.1, 1_000_000)) == [("c", 9)]
    assert take(box) == []


def test_a_full_lane_refuses_qos_0_and_counts_it(box, stats):
    for name in "abc":
        assert put(box, name)
    assert not put(box, "d")
    assert box.spool.put(durable("durable"))
    assert (stats.dropped, stats.queued) == (1, 4)


def test_bytes_bound_qos_0_too(stats, clock):
    box = online(stats, clock, messages=100, size=2 * (OVERHEAD + PACKET))
    assert [put(box, name) for name in "abc"] == [True, True, False]
    assert stats.queued_bytes == 2 * (OVERHEAD + PACKET)
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
    assert take(box, size=PACKET + 1) == ["a", "b"]
    assert take(box, size=PACKET + 1) == ["c"]


def test_a_closed_box_takes_nothing_and_keeps_nothing(box, stats):
    box.spool.put(durable("a"))
    put(box, "b")
    box.close()
    assert not box.spool.put(durable("c"))
    assert not put(box, "d")
    assert stats.queued == 0
