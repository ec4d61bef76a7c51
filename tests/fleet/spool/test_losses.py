"""What is told about lost messages."""

import pytest

from fleet.spool.losses import Gap, MessageLosses, Reason
from fleet.wire.rules import TrafficClass

STATUS, EVENT = TrafficClass.STATUS, TrafficClass.EVENT


@pytest.fixture
def losses():
    return MessageLosses()


def test_a_gap_says_how_many_were_lost_and_from_when_to_when(losses):
    losses.note("t", EVENT, Reason.ROOM, 100.0)
    losses.note("t", EVENT, Reason.ROOM, 101.0, 3)
    losses.note("t", EVENT, Reason.ROOM, 107.0)
    assert losses.take() == [Gap("t", Reason.ROOM, 5, 100.0, 107.0)]


def test_each_topic_and_each_reason_has_its_own_gap(losses):
    losses.note("t", EVENT, Reason.ROOM, 1.0)
    losses.note("t", EVENT, Reason.AGE, 2.0)
    losses.note("u", EVENT, Reason.ROOM, 3.0)
    assert [(gap.topic, gap.reason, gap.lost) for gap in losses.known()] == [
        ("t", Reason.ROOM, 1),
        ("t", Reason.AGE, 1),
        ("u", Reason.ROOM, 1),
    ]


def test_the_counts_by_class_and_reason_go_on_when_the_gaps_are_taken(losses):
    losses.note("t", EVENT, Reason.ROOM, 1.0, 2)
    losses.note("u", EVENT, Reason.ROOM, 1.0)
    losses.take()
    losses.note("t", STATUS, Reason.REFUSED, 1.0)
    assert losses.counts == {(EVENT, Reason.ROOM): 3, (STATUS, Reason.REFUSED): 1}
    assert losses.total == 4


def test_what_was_taken_is_known_no_more_and_a_new_loss_begins_a_new_gap(losses):
    losses.note("t", EVENT, Reason.AGE, 1.0, 7)
    losses.take()
    assert (losses.known(), losses.take()) == ([], [])
    losses.note("t", EVENT, Reason.AGE, 9.0)
    assert losses.known() == [Gap("t", Reason.AGE, 1, 9.0, 9.0)]


def test_a_change_is_to_be_written_also_that_the_gaps_were_taken(losses):
    assert not losses.changed
    losses.take()
    assert not losses.changed
    losses.note("t", EVENT, Reason.AGE, 1.0)
    assert losses.changed
    losses.changed = False
    losses.take()
    assert losses.changed
    losses.take()
    assert losses.changed


def test_the_gaps_of_an_earlier_process_are_reported_but_count_for_that_process(losses):
    losses.add([Gap("t", Reason.AGE, 4, 1.0, 2.0)])
    assert (losses.total, losses.changed) == (0, False)
    losses.note("t", EVENT, Reason.AGE, 9.0)
    assert losses.total == 1
    assert losses.take() == [Gap("t", Reason.AGE, 5, 1.0, 9.0)]


def test_gaps_that_are_read_again_from_disk_are_not_counted_twice(losses):
    """As when the disk fails after its losses were read, and is opened again."""
    losses.note("t", EVENT, Reason.AGE, 5.0, 2)
    losses.add([Gap("t", Reason.AGE, 2, 5.0, 5.0), Gap("u", Reason.ROOM, 1, 3.0, 3.0)])
    assert losses.take() == [Gap("t", Reason.AGE, 2, 5.0, 5.0), Gap("u", Reason.ROOM, 1, 3.0, 3.0)]
