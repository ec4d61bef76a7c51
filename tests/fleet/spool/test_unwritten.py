import pytest

from fleet.spool.message import Outgoing
from fleet.spool.unwritten import GRACE, MOST_ROWS, MOST_TOMBSTONES, UnwrittenMessages
from fleet.wire.rules import TrafficClass


@pytest.fixture
def unwritten():
    return UnwrittenMessages()


def add(unwritten, count, since=0.0):
    made = [Outgoing("t", b"%d" % number, 1, TrafficClass.EVENT, since=since) for number in range(count)]
    for message in made:
        unwritten.add(message)
    return made


def tombstone(unwritten, messages):
    for message in messages:
        message.gone = True
        unwritten.tombstone()


def test_while_connected_only_what_has_waited_is_written(unwritten):
    old, new = add(unwritten, 3), add(unwritten, 3, since=GRACE)
    assert unwritten.take(GRACE, at_once=False) == old
    assert unwritten.take(GRACE, at_once=True) == new


def test_one_transaction_writes_a_part_at_most_and_the_next_goes_on(unwritten):
    made = add(unwritten, MOST_ROWS + 10)
    assert unwritten.take(0.0, at_once=True) + unwritten.take(0.0, at_once=True) == made


def test_what_nobody_waits_for_is_not_written(unwritten):
    made = add(unwritten, 10)
    tombstone(unwritten, made[::2])
    assert unwritten.take(0.0, at_once=True) == made[1::2]


def test_behind_a_disk_that_hangs_only_what_somebody_waits_for_is_kept(unwritten):
    waiting = add(unwritten, 20)
    for _ in range(50):
        tombstone(unwritten, add(unwritten, MOST_TOMBSTONES))
    assert len(unwritten) <= 2 * MOST_TOMBSTONES + len(waiting)
    assert unwritten.take(0.0, at_once=True) == waiting


def test_what_could_not_be_written_is_written_first_the_next_time(unwritten):
    first, later = add(unwritten, 4), add(unwritten, 2)
    rows = unwritten.take(0.0, at_once=True)
    unwritten.requeue(rows[:4])
    assert not any(message.stored for message in first)
    tombstone(unwritten, first[:1])
    assert unwritten.take(0.0, at_once=True) == first[1:]
    assert all(message.stored for message in later)
