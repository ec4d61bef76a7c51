"""The statuses of actions: repeats are answered like the first, refusals too, and not for ever."""

import pytest

from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.action_statuses import KEPT, ActionStatuses
from fleet.model.command import Reply, ReplyStatus
from fleet.model.geometry import Vector3
from fleet.model.navigation import ActionState, Control, Goal, GoTo, Navigate
from fleet.model.report import NavigationReport
from fleet.testing.clock import ManualClock

GOTO = GoTo(Goal(Vector3()))


@pytest.fixture
def said():
    return []


@pytest.fixture
def statuses(said):
    return ActionStatuses(said.append, ManualClock(), RobotJournal())


def queued(action):
    return NavigationReport(0.0, action, ActionState.QUEUED, 0.0, "")


def states(said):
    return [str(status.state) for status in said]


def test_a_repeated_id_gets_the_newest_status_and_the_same_answer(statuses, said):
    first, again = [], []
    receipt = Receipt("navigate", first.append)
    statuses.remember(queued("a1"), receipt)
    statuses.publish(NavigationReport(1.0, "a1", ActionState.COMPLETED, 100.0, ""))
    receipt.done()
    assert statuses.repeated("a1", Receipt("navigate", again.append))
    assert states(said) == ["completed", "completed"]
    assert again == first


def test_a_goal_that_was_refused_is_refused_when_it_is_delivered_again(statuses, said):
    receipt = Receipt("navigate", lambda _: None)
    receipt.reject("it is offline")
    statuses.refuse(Navigate(GOTO, "a1"), "it is offline", receipt)
    again = []
    assert statuses.repeated("a1", Receipt("navigate", again.append))
    assert [answer.reason for answer in again] == ["it is offline"]
    assert states(said) == ["failed", "failed"]


@pytest.mark.parametrize("action", ["", "a9"])
def test_unknown_and_empty_ids_are_no_repeats(statuses, action):
    statuses.remember(queued(""), Receipt("navigate", lambda _: None))
    assert not statuses.repeated(action, Receipt("navigate", lambda _: None))


def test_only_so_many_are_remembered(statuses):
    for number in range(KEPT + 5):
        statuses.remember(queued(f"a{number}"), Receipt("navigate", lambda _: None))
    assert not statuses.knows("a0")
    assert statuses.knows(f"a{KEPT + 4}")


@pytest.mark.parametrize(
    ("done", "state"),
    [(True, ["completed"]), (False, ["failed"]), (None, [])],
    ids=["did", "failed", "taken"],
)
def test_a_control_with_an_id_of_its_own_has_a_status_once_it_has_ended(statuses, said, done, state):
    statuses.controlled(Navigate(Control.PAUSE, "p1"), Reply("pause", ReplyStatus.ACCEPTED, done=done))
    assert states(said) == state


def test_a_control_without_an_id_or_with_that_of_an_action_has_no_status_of_its_own(statuses, said):
    statuses.remember(queued("a1"), Receipt("navigate", lambda _: None))
    for action in ("", "a1"):
        statuses.controlled(Navigate(Control.PAUSE, action), Reply("pause", ReplyStatus.ACCEPTED, done=True))
    assert said == []
