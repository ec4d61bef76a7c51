"""The last command of a robot is shown with its own outcome, whatever becomes of those before."""

import pytest

from fleet.errors import LinkLost, NotReady
from fleet.host.requests.last_command import BOOKKEEPING, LastCommand
from fleet.host.requests.receipt import Receipt


def follow(last, command):
    receipt = Receipt(command, lambda _: None)
    last.follow(command, receipt)
    return receipt


def shown(last):
    return last.command, last.outcome


@pytest.fixture
def last():
    return LastCommand()


def test_a_robot_that_was_not_commanded_shows_nothing(last):
    assert shown(last) == ("", "")


def test_a_command_is_under_way_accepted_and_done(last):
    receipt = follow(last, "land")
    assert shown(last) == ("land", "under way")
    receipt.accept()
    assert shown(last) == ("land", "accepted")
    receipt.done()
    assert shown(last) == ("land", "done")


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        (lambda receipt: receipt.reject("anna has control"), "rejected: anna has control"),
        (lambda receipt: receipt.fail(NotReady("it slips")), "denied: it slips"),
        (lambda receipt: receipt.fail(LinkLost("no cable")), "timeout: no cable"),
    ],
)
@pytest.mark.parametrize("accepted", [False, True])
def test_a_failure_is_shown_with_its_reason(last, end, outcome, accepted):
    receipt = follow(last, "land")
    if accepted:
        receipt.accept()
    end(receipt)
    assert shown(last) == ("land", outcome)


def test_one_that_has_ended_before_is_shown_as_it_ended(last):
    receipt = Receipt("land", lambda _: None)
    receipt.reject("it has no land")
    last.follow("land", receipt)
    assert shown(last) == ("land", "rejected: it has no land")


def test_a_command_that_was_superseded_does_not_answer_for_the_one_that_did_it(last):
    """Whoever stops a robot reads this outcome: a failed stop must not be shown as done."""
    walk = follow(last, "walk")
    walk.accept()
    stop = follow(last, "emergency_stop")
    stop.fail(NotReady("HOLD was refused"))
    walk.done()
    assert shown(last) == ("emergency_stop", "denied: HOLD was refused")


def test_a_stop_that_is_done_stays_done_when_what_it_ended_ends_later(last):
    walk = follow(last, "walk")
    follow(last, "emergency_stop").done()
    walk.fail(NotReady("it was stopped"))
    assert shown(last) == ("emergency_stop", "done")


def test_a_velocity_is_accepted_and_no_earlier_command_answers_for_it(last):
    walk = follow(last, "walk")
    last.accepted("velocity")
    assert shown(last) == ("velocity", "accepted")
    walk.reject("no")
    assert shown(last) == ("velocity", "accepted")


def test_the_same_command_twice_is_shown_as_the_second_went(last):
    first, second = follow(last, "land"), follow(last, "land")
    second.accept()
    first.reject("busy")
    assert shown(last) == ("land", "accepted")


@pytest.mark.parametrize("command", sorted(BOOKKEEPING))
def test_that_a_run_takes_and_returns_a_robot_is_not_shown(last, command):
    land = follow(last, "land")
    follow(last, command).reject("it is in another run")
    assert shown(last) == ("land", "under way")
    land.done()
    assert shown(last) == ("land", "done")
