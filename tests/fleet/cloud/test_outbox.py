import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud.outbox import OVERHEAD, Outbox, Outgoing
from fleet.cloud.values import CloudStats


def message(name, qos=1, *, urgent=False, deadline=None):
    return Outgoing(name, b"x" * 10, qos, urgent, deadline)


def names(messages):
    return [one.topic for one in messages]


@pytest.fixture
def box():
    box = Outbox(3, 10_000, CloudStats())
    box.go_online()
    return box


def take(box, *, now=0.0, window=100, reserve=0, size=1_000_000):
    return names(box.take(now, window=window, reserve=reserve, size=size))


def test_urgent_goes_before_qos_1_and_qos_1_before_qos_0(box):
    for one in (message("light", 0), message("lasting"), message("urgent", urgent=True)):
        assert box.put(one)
    assert take(box) == ["urgent", "lasting", "light"]


def test_qos_1_waits_for_the_window_and_holds_qos_0_up_not_at_all(box):
    for one in (message("a"), message("b"), message("light", 0)):
        box.put(one)
    assert take(box, window=1) == ["a", "light"]
    assert take(box, window=0) == []
    assert take(box, window=1) == ["b"]


def test_the_end_of_the_window_is_kept_for_urgent_messages(box):
    box.put(message("lasting"))
    box.put(message("urgent", urgent=True))
    assert take(box, window=2, reserve=2) == ["urgent"]


def test_a_full_queue_drops_its_oldest_for_qos_1_and_qos_0_before_that(box):
    for one in (message("a"), message("light", 0), message("b"), message("c"), message("d")):
        assert box.put(one)
    assert names(box.take_dropped()) == ["light", "a"]
    assert take(box) == ["b", "c", "d"]


def test_a_full_queue_refuses_qos_0(box):
    for name in "abc":
        box.put(message(name))
    assert not box.put(message("light", 0))
    assert take(box) == ["a", "b", "c"]


def test_urgent_messages_are_not_pushed_out_by_others(box):
    for name in "abc":
        box.put(message(name, urgent=True))
    assert not box.put(message("lasting"))
    assert box.put(message("d", urgent=True))
    assert take(box) == ["b", "c", "d"]


def test_bytes_bound_the_queue_too():
    box = Outbox(100, 2 * (OVERHEAD + 10), CloudStats())
    for name in "abc":
        assert box.put(message(name))
    assert take(box) == ["b", "c"]
    assert not box.put(Outgoing("huge", b"x" * 1000, 1))


def test_without_a_connection_qos_0_is_refused_and_what_waits_is_dropped(box):
    for one in (message("light", 0), message("soon", 0, urgent=True), message("lasting")):
        box.put(one)
    box.go_offline()
    assert not box.put(message("light", 0))
    assert set(names(box.take_dropped())) == {"light", "soon"}
    assert take(box) == ["lasting"]


def test_what_ran_out_of_time_is_dropped_and_never_sent(box):
    for one in (message("old", deadline=5.0), message("new", deadline=6.0), message("ever")):
        box.put(one)
    assert take(box, now=5.0) == ["new", "ever"]
    assert names(box.take_dropped()) == ["old"]


def test_time_is_looked_after_while_nothing_is_sent(box):
    box.put(message("old", deadline=5.0))
    box.expire(5.0)
    assert names(box.take_dropped()) == ["old"]
    assert not len(box)


def test_what_was_not_acknowledged_goes_first_again_in_its_order(box):
    for name in "abc":
        box.put(message(name))
    sent = box.take(0.0, window=2, reserve=0, size=1_000_000)
    box.put_back(sent)
    assert [(one.topic, one.again) for one in box.take(0.0, window=9, reserve=0, size=1_000_000)] == [
        ("a", True),
        ("b", True),
        ("c", False),
    ]


def test_one_batch_is_bounded_in_bytes(box):
    for name in "abc":
        box.put(message(name))
    assert take(box, size=OVERHEAD + 11) == ["a", "b"]
    assert take(box, size=OVERHEAD + 11) == ["c"]


@given(st.lists(st.tuples(st.integers(0, 1), st.booleans(), st.integers(0, 400)), max_size=40))
def test_the_bounds_hold_and_every_message_is_accounted_for(messages):
    stats = CloudStats()
    box, taken = Outbox(5, 2000, stats), 0
    box.go_online()
    for qos, urgent, size in messages:
        taken += box.put(Outgoing("t", b"x" * size, qos, urgent))
        assert len(box) <= 5
    sent = box.take(0.0, window=100, reserve=0, size=100_000)
    assert sum(one.size for one in sent) <= 2000
    assert len(sent) + len(box.take_dropped()) == taken
    assert stats.queued == 0
    assert stats.dropped == len(messages) - len(sent)
