"""The bound on the messages in memory, and which of them give way."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.spool.memory_buffer import DURABLE, MemoryBuffer
from fleet.spool.message import OVERHEAD, Outgoing
from fleet.wire.rules import TrafficClass

REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT
ROOMY = 10**6


def message(seq, traffic=EVENT, payload=b"", deadline=None):
    return Outgoing("t", payload, 1, traffic, seq=seq, deadline=deadline)


def filled(messages, *, most=100, size=ROOMY):
    buffer = MemoryBuffer(most, size)
    for each in messages:
        buffer.add(each)
    return buffer


def make_room(buffer, new, share=1):
    """Drop what gives way for a message; return the sequence numbers dropped."""
    dropped = []
    for each in buffer.droppable(new, share):
        buffer.remove(each)
        dropped.append(each.seq)
    return dropped


def test_the_durable_classes_are_in_the_order_of_their_importance():
    assert DURABLE == (REPLY, STATUS, EVENT)
    assert [int(traffic) for traffic in DURABLE] == [0, 1, 2]


@pytest.mark.parametrize(
    ("count", "room", "full"), [(0, 3, False), (2, 1, False), (3, 0, True), (4, 0, True)]
)
def test_it_is_full_by_the_number_of_messages(count, room, full):
    buffer = filled(map(message, range(count)), most=3)
    assert (buffer.count, buffer.room, buffer.full) == (count, room, full)
    assert buffer.fits(message(9)) is not full


@pytest.mark.parametrize(("spare", "full", "fits"), [(-1, True, False), (0, True, False), (1, False, False)])
def test_it_is_full_by_the_bytes_of_payloads_and_overheads(spare, full, fits):
    buffer = filled([message(1, payload=b"x" * 10)], size=OVERHEAD + 10 + spare)
    assert (buffer.full, buffer.fits(message(2))) == (full, fits)


def test_a_message_fits_up_to_the_last_byte_of_the_bound():
    buffer = filled([message(1)], size=2 * OVERHEAD + 10)
    assert buffer.fits(message(2, payload=b"x" * 10))
    assert not buffer.fits(message(2, payload=b"x" * 11))


def test_a_share_of_two_doubles_both_bounds():
    by_number = filled([message(1), message(2)], most=1, size=ROOMY)
    assert not by_number.fits(message(3), 2)
    by_number.remove(message(1))
    assert by_number.fits(message(3), 2)
    by_bytes = filled([message(1)], size=OVERHEAD)
    assert by_bytes.fits(message(2), 2)
    assert not by_bytes.fits(message(2, payload=b"x"), 2)


def test_a_message_can_fit_unless_more_important_ones_take_the_room():
    buffer = filled([message(1, REPLY), message(2, EVENT)], most=2)
    assert all(buffer.can_fit(message(3, traffic), 1) for traffic in DURABLE)
    buffer.add(message(4, REPLY))
    assert not buffer.can_fit(message(5, STATUS), 1)
    assert buffer.can_fit(message(5, STATUS), 2)
    assert buffer.can_fit(message(5, REPLY), 1)


def test_a_message_can_fit_only_within_the_bytes_that_more_important_ones_leave():
    buffer = filled([message(1, REPLY, b"x" * 100)], size=2 * OVERHEAD + 100)
    assert buffer.can_fit(message(2, EVENT), 1)
    assert not buffer.can_fit(message(2, EVENT, b"x"), 1)
    assert buffer.can_fit(message(2, EVENT, b"x"), 2)
    assert buffer.can_fit(message(2, REPLY, b"x" * (OVERHEAD + 100)), 1)
    assert not buffer.can_fit(message(2, REPLY, b"x" * (OVERHEAD + 101)), 1)


def test_the_oldest_of_the_least_important_class_give_way_first():
    buffer = filled([message(1, REPLY), message(2, EVENT), message(3, STATUS), message(4, EVENT)], most=2)
    assert make_room(buffer, message(5, STATUS)) == [2, 4, 3]
    assert [each.seq for each in buffer.all()] == [1]


def test_nothing_gives_way_for_a_message_that_fits():
    assert make_room(filled([message(1)], most=2), message(2)) == []
    assert make_room(filled([message(1)], most=1), message(2), share=2) == []


def test_a_removed_message_leaves_its_room_once():
    first, second = message(1, REPLY, b"x"), message(2, REPLY, b"yy")
    buffer = filled([first, second], most=2, size=2 * OVERHEAD + 3)
    buffer.remove(first)
    buffer.remove(first)
    assert (buffer.count, buffer.room, buffer.all()) == (1, 1, [second])
    assert buffer.fits(message(3, payload=b"x"))
    assert not buffer.fits(message(3, payload=b"xx"))
    assert buffer.can_fit(message(3, EVENT, b"x"), 1)
    assert not buffer.can_fit(message(3, EVENT, b"xx"), 1)


def test_a_message_that_returns_is_the_oldest_of_its_class():
    newer = [message(2), message(3)]
    buffer = filled(newer, most=2)
    buffer.add_again(message(1))
    assert [each.seq for each in buffer.all()] == [1, 2, 3]
    assert make_room(buffer, message(4)) == [1, 2]


def late(buffer, now):
    expired = []
    for each in buffer.late(now):
        buffer.remove(each)
        expired.append(each.seq)
    return expired


def test_messages_of_every_class_are_late_from_their_deadline_on():
    buffer = filled(
        [message(1, REPLY, deadline=5.0), message(2, EVENT, deadline=3.0), message(3, deadline=9.0)]
    )
    assert late(buffer, 2.9) == []
    assert late(buffer, 5.0) == [1, 2]
    assert late(buffer, 9.0) == [3]


def test_a_message_without_a_deadline_is_never_late():
    assert late(filled([message(1)]), float("inf")) == []


@given(
    held=st.lists(st.tuples(st.sampled_from(DURABLE), st.integers(0, 900)), max_size=12),
    new=st.tuples(st.sampled_from(DURABLE), st.integers(0, 3000)),
    most=st.integers(1, 6),
    size=st.integers(OVERHEAD, 6 * OVERHEAD),
    share=st.sampled_from([1, 2]),
)
def test_room_is_made_exactly_if_a_message_can_fit_and_never_by_more_important_ones(
    held, new, most, size, share
):
    buffer = filled(
        [message(seq, traffic, bytes(length)) for seq, (traffic, length) in enumerate(held)],
        most=most,
        size=size,
    )
    before = {each.seq: each for each in buffer.all()}
    one = message(99, new[0], bytes(new[1]))
    if not buffer.can_fit(one, share):
        return
    dropped = make_room(buffer, one, share)
    assert buffer.fits(one, share)
    assert all(before[seq].traffic >= one.traffic for seq in dropped)
    if dropped:  # not one more than it takes
        buffer.add_again(before[dropped[-1]])
        assert not buffer.fits(one, share)
