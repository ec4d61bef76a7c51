"""What is started and what is skipped of what came due: one of several, never all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.schedules.due_firings import MOST, DueFirings, due_firings
from fleet.schedules.triggers import Trigger

MINUTELY = Trigger(every=60.0)


def test_nothing_is_due_before_its_time():
    assert due_firings(MINUTELY, 600.0, 659.9, late=30.0, once=False) == DueFirings()


def test_what_is_due_is_started():
    assert due_firings(MINUTELY, 600.0, 660.0, late=30.0, once=False) == DueFirings(due=660.0)


def test_of_several_only_the_newest_is_started_and_the_others_are_reported():
    found = due_firings(MINUTELY, 600.0, 800.0, late=600.0, once=False)
    assert found == DueFirings(due=780.0, skipped=((660.0, _LATER), (720.0, _LATER)))


_LATER = "a later one was due as well"


def test_what_is_too_late_is_missed_and_counted():
    found = due_firings(MINUTELY, 600.0, 900.0 + 30.0, late=20.0, once=False)
    assert found == DueFirings(missed=5, first_missed=660.0)


def test_one_start_makes_up_for_all_that_were_missed():
    assert due_firings(MINUTELY, 600.0, 930.0, late=20.0, once=True) == DueFirings(
        due=900.0, missed=4, first_missed=660.0
    )
    assert due_firings(MINUTELY, 600.0, 905.0, late=20.0, once=True) == DueFirings(
        due=900.0, missed=4, first_missed=660.0
    )


def test_after_a_year_off_no_more_than_so_many_are_looked_at():
    found = due_firings(MINUTELY, 600.0, 600.0 + 365 * 86400.0, late=20.0, once=False)
    assert found.missed == MOST


def test_a_firing_that_is_just_as_late_as_it_may_be_is_started():
    assert due_firings(MINUTELY, 600.0, 680.0, late=20.0, once=False) == DueFirings(due=660.0)
    assert due_firings(MINUTELY, 600.0, 680.1, late=20.0, once=False).due is None


@given(
    st.floats(0, 1e5),
    st.lists(st.floats(0.1, 3000.0), min_size=1, max_size=20),
    st.floats(1.0, 2000.0),
    st.booleans(),
)
def test_looking_again_and_again_neither_loses_nor_doubles_a_firing(begin, steps, late, once):
    """Every firing of the time line is started, skipped or counted as missed, exactly once."""
    seen, accounted, started = begin, 0, []
    for step in steps:
        found = due_firings(MINUTELY, seen, seen + step, late=late, once=once)
        accounted += (found.due is not None) + len(found.skipped) + found.missed
        started += [found.due] if found.due is not None else []
        seen += step
    assert accounted == pytest.approx(seen // 60 - begin // 60, abs=0)
    assert started == sorted(set(started))
