"""Actions on adapters whose navigation behaves badly."""

import asyncio
import contextlib
import types

import pytest

from fleet.errors import LinkLost
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.navigator import Navigator
from fleet.host.runtime.cancellation import cancel_and_wait
from fleet.model.geometry import Vector3
from fleet.model.navigation import FollowPath, Goal, GoTo, Navigate, Progress, RelativeMove
from fleet.testing.clock import ManualClock

GOALS = tuple(Goal(Vector3(float(x), 0.0, 0.0)) for x in range(3))
GOTO = GoTo(GOALS[0])


class Bench:
    """A navigator; ``navigate`` is the adapter's, set by the test."""

    def __init__(self):
        self.said, self.held, self.crashes, self.tasks = [], [], [], []
        self.go = asyncio.Event()
        self.closed = 0
        self.adapter = types.SimpleNamespace(navigate=self.navigate)
        self.navigator = Navigator(
            publish=self.said.append,
            hold=self.held.append,
            end=lambda task, why: cancel_and_wait(task, why, self.crashes.append),
            crashed=self.crashes.append,
            journal=RobotJournal(),
            clock=ManualClock(),
        )

    async def navigate(self, task):
        self.tasks.append(task)
        try:
            yield Progress(10, reached=1)
            await self.go.wait()
        finally:
            self.closed += 1

    def start(self, task=GOTO, action="a1", navigate=None):
        self.adapter.navigate = navigate or self.navigate
        answers = []
        receipt = Receipt("navigate", answers.append, waits=True)
        self.navigator.start(self.adapter, Navigate(task, action), task, receipt)
        return answers

    def states(self, action="a1"):
        return [str(status.state) for status in self.said if status.action_id == action]


@pytest.fixture
async def bench():
    bench = Bench()
    yield bench
    bench.go.set()
    bench.navigator.cancel("the test ends")
    await asyncio.sleep(0)


async def blocked_then_done(task):
    yield Progress(50, "a dog", blocked=True)


async def test_an_action_that_was_blocked_at_last_still_ends(bench, requests):
    answers = bench.start(navigate=blocked_then_done)
    await requests.settle()
    assert bench.states() == ["queued", "running", "blocked", "running", "completed"]
    assert answers[-1].done
    assert not bench.navigator.active


async def test_an_action_that_is_ended_before_it_began_is_answered(bench, requests):
    answers = bench.start()
    bench.navigator.cancel("stopped")
    await requests.settle()
    assert bench.states() == ["queued", "cancelled"]
    assert [answer.done for answer in answers] == [None]
    assert bench.tasks == []


async def test_an_action_that_is_ended_is_cleaned_up_at_once(bench, requests):
    bench.start()
    await requests.settle()
    bench.navigator.cancel("stopped")
    await requests.settle()
    assert bench.closed == 1


async def test_ending_it_the_moment_it_completes_says_one_end(bench, requests):
    bench.start()
    await requests.settle()
    bench.go.set()
    bench.navigator.cancel("stopped")
    await requests.settle()
    assert bench.states()[-1] == "cancelled"
    assert sum(status.state.terminal for status in bench.said) == 1


async def test_navigation_that_ignores_its_end_has_no_say_any_more(bench, requests):
    async def deaf(task):
        while not bench.go.is_set():
            try:
                await bench.go.wait()
            except asyncio.CancelledError:
                yield Progress(77, "on and on")

    bench.start(navigate=deaf)
    await requests.settle()
    bench.navigator.pause()
    await requests.settle()
    bench.go.set()
    await requests.settle()
    assert bench.states() == ["queued", "running", "running"]
    assert bench.said[-1].message == "paused"


async def test_navigation_that_goes_on_after_its_end_is_a_crash(bench, requests, monkeypatch):
    monkeypatch.setattr("fleet.host.runtime.cancellation.IGNORED_AFTER", 0.01)

    async def deaf(task):
        while not bench.go.is_set():
            with contextlib.suppress(asyncio.CancelledError):
                await bench.go.wait()
        yield Progress(1)

    bench.start(navigate=deaf)
    await requests.settle()
    bench.navigator.cancel("stopped")
    await requests.until(lambda: bench.crashes)


async def test_navigation_that_cancels_itself_has_failed_and_the_robot_is_held(bench, requests):
    async def stray(task):
        yield Progress(1)
        raise asyncio.CancelledError

    bench.start(navigate=stray)
    await requests.settle()
    assert bench.states()[-1] == "failed"
    assert len(bench.held) == 1


async def test_navigation_that_cannot_be_held_does_not_leave_a_failed_task(bench, requests):
    async def lost(task):
        raise LinkLost("the cable came out")
        yield

    bench.start(navigate=lost)
    await requests.settle()
    assert bench.states()[-1] == "failed"
    assert bench.held == ["navigation failed: the cable came out"]


async def test_a_goal_that_the_adapter_refuses_at_once_holds_the_robot(bench, requests):
    def refuses(task):
        raise LinkLost("no")

    bench.start()
    await requests.settle()
    bench.start(action="a2", navigate=refuses)
    await requests.settle()
    assert bench.states("a2")[-1] == "failed"
    assert len(bench.held) == 1


async def test_a_paused_path_is_gone_on_with_where_it_was(bench, requests):
    bench.start(FollowPath(GOALS))
    await requests.settle()
    assert bench.navigator.pause()
    await requests.settle()
    assert bench.navigator.resume(bench.adapter)
    await requests.settle()
    assert bench.tasks == [FollowPath(GOALS), FollowPath(GOALS[1:])]


async def test_a_relative_move_is_ended_by_a_pause(bench, requests):
    bench.start(RelativeMove(Vector3(1.0, 0.0, 0.0)))
    await requests.settle()
    assert bench.navigator.pause()
    assert bench.states()[-1] == "cancelled"
    assert not bench.navigator.resume(bench.adapter)


async def test_a_repeated_id_gets_the_last_status_and_the_same_answers(bench, requests):
    first = bench.start()
    await requests.settle()
    again = []
    assert bench.navigator.statuses.repeated("a1", Receipt("navigate", again.append, waits=True))
    bench.go.set()
    await requests.settle()
    assert bench.states() == ["queued", "running", "running", "completed"]
    assert again == first
    assert len(bench.tasks) == 1
