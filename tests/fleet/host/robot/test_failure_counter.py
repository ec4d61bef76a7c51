"""How many failures, and how close together, are a quarantine."""

from fleet.host.robot.failure_counter import FAILURE_WINDOW, MOST_FAILURES, FailureCounter


def struck(*times):
    failures = FailureCounter()
    for time in times:
        failures.count(time)
    return failures


def test_as_many_failures_as_are_allowed_within_the_window_are_too_many():
    assert struck(0.0, 1.0, FAILURE_WINDOW).exceeded
    assert not struck(*range(MOST_FAILURES - 1)).exceeded


def test_failures_further_apart_are_not():
    assert not struck(0.0, 1.0, FAILURE_WINDOW + 0.1).exceeded


def test_an_older_failure_makes_room_for_a_newer_one():
    assert struck(0.0, 100.0, 101.0, 102.0).exceeded


def test_lifting_a_quarantine_forgets_the_failures():
    failures = struck(0.0, 1.0, 2.0)
    failures.clear()
    failures.count(3.0)
    assert not failures.exceeded
