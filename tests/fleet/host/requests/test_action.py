import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.requests.action import REPEAT, Action
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Vector3
from fleet.model.navigation import (
    NEXT,
    ActionState,
    FlyMission,
    FollowPath,
    Goal,
    GoTo,
    PlanItem,
    Progress,
)
from fleet.testing.clock import ManualClock

GOALS = tuple(Goal(Vector3(float(x), 0.0, 0.0)) for x in range(3))


class Life:
    """An action and everything it said."""

    def __init__(self, task=None):
        self.clock, self.said, self.ends = ManualClock(), [], []
        self.action = Action(
            "a1",
            task or GoTo(GOALS[0]),
            publish=self.said.append,
            ended=self.ends.append,
            clock=self.clock,
        )

    def states(self):
        return [str(status.state) for status in self.said]


def test_what_was_blocked_can_still_arrive():
    life = Life()
    life.action.move(ActionState.RUNNING)
    life.action.progress(Progress(40, "a dog", blocked=True))
    life.action.complete()
    assert life.states() == ["queued", "running", "blocked", "running", "completed"]
    assert len(life.ends) == 1


def test_progress_never_falls_and_is_complete_only_at_the_end():
    life = Life()
    for percent in (10, 50, 30, 100, 250):
        life.clock.advance(REPEAT)
        life.action.progress(Progress(percent))
    life.action.complete()
    assert [status.progress for status in life.said] == [0, 10, 50, 50, 99, 99, 100]


def test_progress_that_comes_too_often_is_thinned_out():
    life = Life()
    life.action.move(ActionState.RUNNING)
    for percent in range(100):
        life.clock.advance(0.01)
        life.action.progress(Progress(percent))
    assert len(life.said) <= 4


def test_a_status_tells_what_is_left_of_the_way_until_the_end():
    life = Life()
    for metres in (9.0, 8.0, 7.0):
        life.clock.advance(1.0)
        life.action.progress(Progress(10.0, remaining=metres))
    assert (life.said[-1].remaining, life.said[-1].eta) == (7.0, pytest.approx(7.0))
    life.action.pause()
    assert (life.said[-1].remaining, life.said[-1].eta) == (7.0, None)
    life.action.complete()
    assert (life.said[-1].remaining, life.said[-1].eta) == (None, None)


def test_a_new_message_is_reported_at_once():
    life = Life()
    life.action.move(ActionState.RUNNING)
    life.action.progress(Progress(1, "turning"))
    assert life.said[-1].message == "turning"


@pytest.mark.parametrize(
    ("loops", "reached", "left"),
    [(1, 0, (0, 1, 2)), (1, 2, (2,)), (2, 4, (1, 2)), (1, 3, (2,)), (1, 99, (2,)), (1, -2, (0, 1, 2))],
)
def test_a_paused_path_goes_on_with_the_goals_that_are_left(loops, reached, left):
    life = Life(FollowPath(GOALS, loops))
    life.action.move(ActionState.RUNNING)
    life.action.progress(Progress(1, reached=reached))
    life.action.pause()
    assert life.action.task == FollowPath(tuple(GOALS[index] for index in left))


def test_a_path_that_is_paused_twice_loses_no_goal_and_repeats_none():
    life = Life(FollowPath(GOALS))
    life.action.move(ActionState.RUNNING)
    for _ in range(2):
        life.action.progress(Progress(1, reached=1))
        life.action.pause()
        life.action.resume()
    assert life.action.task.goals == GOALS[2:]


def test_a_pause_before_any_progress_keeps_the_whole_path():
    life = Life(FollowPath(GOALS))
    life.action.pause()
    life.action.pause()
    assert life.action.task.goals == GOALS


STEPS = st.lists(
    st.sampled_from([*ActionState])
    | st.builds(
        Progress,
        st.floats(allow_nan=True, allow_infinity=True),
        blocked=st.booleans(),
        reached=st.integers(-5, 50),
    )
    | st.sampled_from(["pause", "resume", "complete"]),
    max_size=30,
)


@given(STEPS)
def test_whatever_happens_the_states_follow_each_other_to_at_most_one_end(steps):
    life = Life(FollowPath(GOALS, 2))
    for step in steps:
        life.clock.advance(0.3)
        if isinstance(step, ActionState):
            life.action.move(step)
        elif isinstance(step, Progress):
            life.action.progress(step)
        elif not life.action.over:
            getattr(life.action, step)()
    pairs = zip(life.said, life.said[1:], strict=False)
    assert all(after.state in NEXT[before.state] for before, after in pairs)
    assert len(life.ends) == sum(status.state.terminal for status in life.said) <= 1
    percents = [status.progress for status in life.said]
    assert percents == sorted(percents)
    assert all(math.isfinite(percent) for percent in percents)


def test_a_mission_tells_its_step_and_goes_on_where_it_was_paused():
    item = PlanItem("waypoint", GeoPoint(47.0, 8.0, 10.0))
    life = Life(FlyMission("f", (item,) * 3))
    life.action.move(ActionState.RUNNING)
    life.action.progress(Progress(66, "item 3 of 3", reached=2))
    life.action.pause()
    assert life.action.task.resumed
    life.action.resume()
    life.action.complete()
    assert [status.step for status in life.said] == [0, 0, 2, 2, 2, 2]
    assert life.states()[-1] == "completed"


def test_what_it_does_is_said_in_words():
    item = PlanItem("waypoint", GeoPoint(47.0, 8.0, 10.0))
    life = Life(FlyMission("f", (item,) * 3))
    life.action.move(ActionState.RUNNING)
    life.action.progress(Progress(33.0, "item 2 of 3", reached=1))
    assert life.action.words == "mission, item 2 of 3, 33 %"
    life.action.pause()
    assert life.action.words == "mission, item 2 of 3, 33 %, paused"
    assert Life().action.words == "navigating 0 %"


def test_what_is_left_of_a_paused_mission_is_from_the_item_that_it_is_at():
    items = tuple(PlanItem("waypoint", GeoPoint(47.0, 8.0 + each / 1000, 10.0)) for each in range(3))
    life = Life(FlyMission("survey", items))
    life.action.move(ActionState.RUNNING)
    life.action.progress(Progress(60, reached=2))
    life.action.pause()
    assert life.action.ahead.items == items[2:]
    assert life.action.task.items == items
