"""How many failures, and how close together, are a quarantine."""

from fleet.host.robot.strikes import STRIKE_WINDOW, STRIKES, Strikes


def struck(*times):
    strikes = Strikes()
    for time in times:
        strikes.count(time)
    return strikes


def test_as_many_failures_as_are_allowed_within_the_window_are_too_many():
    assert struck(0.0, 1.0, STRIKE_WINDOW).are_out
    assert not struck(*range(STRIKES - 1)).are_out


def test_failures_further_apart_are_not():
    assert not struck(0.0, 1.0, STRIKE_WINDOW + 0.1).are_out


def test_an_older_failure_makes_room_for_a_newer_one():
    assert struck(0.0, 100.0, 101.0, 102.0).are_out


def test_lifting_a_quarantine_forgets_the_failures():
    strikes = struck(0.0, 1.0, 2.0)
    strikes.clear()
    strikes.count(3.0)
    assert not strikes.are_out
