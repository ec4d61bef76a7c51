"""What a run reads from states and answers: whether a robot is still in it, how a part ended, where it is."""

import msgspec
import pytest

from fleet.missions.observed import SHOWN_WITHIN, RunMembership, facts_of, outcome_of
from fleet.missions.state import PartOutcome
from fleet.model.command import Reply, ReplyStatus
from fleet.model.geometry import Vector3
from fleet.model.state import RobotState
from fleet.testing.clock import ManualClock

STATE = RobotState("rex", "t", "toy", "yard", 0.0, "ok", reachable=True, run="3f2a")


def state(**fields):
    return msgspec.structs.replace(STATE, **fields)


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def membership(clock):
    return RunMembership("3f2a", clock)


def test_a_robot_whose_state_names_the_run_is_in_it(membership):
    assert membership.leave_reason(state()) is None


@pytest.mark.parametrize(
    ("left", "expected"),
    [
        ("taken: land by anna", (PartOutcome.TAKEN, "land by anna")),
        ("stopped: stop by anna", (PartOutcome.STOPPED, "stop by anna")),
        ("lost: no heartbeat: 3 s", (PartOutcome.LOST, "no heartbeat: 3 s")),
        ("taken", (PartOutcome.TAKEN, "its process began anew")),
        ("", (PartOutcome.LOST, "its process began anew")),
        ("vanished: in a puff", (PartOutcome.LOST, "in a puff")),
    ],
)
@pytest.mark.parametrize("run", ["", "77b0"])
def test_a_robot_whose_state_names_no_run_or_another_has_left_as_it_says(membership, left, expected, run):
    assert membership.leave_reason(state(run=run, left_run=left)) == expected


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"emergency_stop": True, "stop_cause": "anna"}, (PartOutcome.STOPPED, "anna")),
        ({"emergency_stop": True}, (PartOutcome.STOPPED, "its emergency stop is set")),
        ({"reachable": False, "cause": "no cable"}, (PartOutcome.LOST, "no cable")),
        ({"reachable": False}, (PartOutcome.LOST, "it does not answer")),
        (
            {"emergency_stop": True, "reachable": False, "cause": "no cable"},
            (PartOutcome.STOPPED, "its emergency stop is set"),
        ),
    ],
)
def test_a_robot_that_is_stopped_or_silent_has_left_though_its_state_names_the_run(
    membership, fields, expected
):
    membership.joined("rex")
    assert membership.leave_reason(state(**fields)) == expected


def test_a_state_from_before_it_joined_proves_nothing(membership, clock):
    old = state(run="", left_run="taken: by anna")
    membership.joined("rex")
    assert membership.leave_reason(old) is None
    clock.advance(SHOWN_WITHIN - 0.1)
    assert membership.leave_reason(old) is None
    clock.advance(0.1)
    assert membership.leave_reason(old) == (PartOutcome.TAKEN, "by anna")


def test_once_its_state_has_shown_that_it_joined_every_later_one_counts(membership):
    membership.joined("rex")
    membership.leave_reason(state())
    assert membership.leave_reason(state(run="")) == (PartOutcome.LOST, "its process began anew")


def test_the_grace_of_one_robot_is_not_that_of_another(membership):
    membership.joined("ada")
    membership.leave_reason(state(name="ada"))
    membership.joined("rex")
    assert membership.leave_reason(state(name="ada", run="")) is not None
    assert membership.leave_reason(state(run="")) is None


@pytest.mark.parametrize("status", list(ReplyStatus))
def test_what_is_done_is_done_whatever_else_the_answer_says(status):
    assert outcome_of(Reply("goto", status, done=True)) is PartOutcome.DONE


@pytest.mark.parametrize("status", list(ReplyStatus))
def test_what_is_not_done_was_late_or_failed(status):
    expected = PartOutcome.LATE if status is ReplyStatus.TIMEOUT else PartOutcome.FAILED
    assert outcome_of(Reply("goto", status, "it stalls", done=False)) is expected


def test_a_receipt_is_no_outcome_and_a_refusal_is_one():
    assert outcome_of(Reply("goto", ReplyStatus.ACCEPTED)) is None
    assert outcome_of(Reply("goto", ReplyStatus.REJECTED, "no")) is PartOutcome.REFUSED
    assert outcome_of(Reply("goto", ReplyStatus.DENIED, "no")) is PartOutcome.REFUSED


def test_of_a_command_that_nobody_acknowledged_nothing_is_known():
    assert outcome_of(Reply("goto", ReplyStatus.TIMEOUT)) is PartOutcome.UNKNOWN


def test_a_position_is_that_of_the_site_and_the_robots_own_only_without_it():
    own, site = Vector3(1.0, 2.0, 3.0), Vector3(7.0, 8.0, 9.0)
    assert facts_of(state(site=site, position=own)).position == (7.0, 8.0, 9.0)
    assert facts_of(state(position=own)).position == (1.0, 2.0, 3.0)
    assert facts_of(state()).position is None


def test_the_facts_of_a_robot_are_those_of_its_state():
    facts = facts_of(state(health="degraded", battery=42.0, activity="goto 40 %"))
    assert (facts.robot, facts.health, facts.battery, facts.progress) == (
        "rex",
        "degraded",
        42.0,
        "goto 40 %",
    )
