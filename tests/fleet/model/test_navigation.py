import itertools

import msgspec
import pytest
from cyberwave.motion import _NAV_TERMINAL_STATUSES

from fleet.model.geometry import Vector3
from fleet.model.navigation import (
    NEXT,
    ActionState,
    Constraints,
    FollowPath,
    Goal,
    GoTo,
    RelativeMove,
    Task,
)

TERMINAL = {ActionState.COMPLETED, ActionState.FAILED, ActionState.CANCELLED}


def test_the_table_covers_every_state():
    assert set(NEXT) == set(ActionState)


@pytest.mark.parametrize("state", ActionState)
def test_the_terminal_states_are_the_ones_that_nothing_follows(state):
    assert state.terminal == (state in TERMINAL) == (not NEXT[state])


def test_every_action_can_end_from_wherever_it_is():
    for state in set(ActionState) - TERMINAL:
        assert {ActionState.FAILED, ActionState.CANCELLED} <= NEXT[state]


def test_nothing_goes_back_into_the_queue():
    assert all(ActionState.QUEUED not in following for following in NEXT.values())


def test_every_state_is_reached_from_the_queue():
    reached = {ActionState.QUEUED}
    for _ in ActionState:
        reached |= set(itertools.chain.from_iterable(NEXT[state] for state in reached))
    assert reached == set(ActionState)


def test_a_blocked_action_goes_on_or_ends_but_is_not_completed_from_there():
    assert NEXT[ActionState.BLOCKED] == {ActionState.RUNNING, ActionState.FAILED, ActionState.CANCELLED}


def test_the_terminal_states_are_terminal_for_the_sdk_too():
    assert {state.value for state in TERMINAL} <= set(_NAV_TERMINAL_STATUSES)


@pytest.mark.parametrize(
    "task",
    [
        GoTo(Goal(Vector3(1, 2, 3), yaw=0.5), Constraints(max_speed=1.0)),
        FollowPath((Goal(Vector3(1)), Goal(Vector3(2), wait=3.0)), loops=2),
        RelativeMove(Vector3(0, 1), body_frame=False),
    ],
)
def test_a_task_keeps_its_kind_through_bytes(task):
    assert msgspec.json.decode(msgspec.json.encode(task), type=Task) == task
