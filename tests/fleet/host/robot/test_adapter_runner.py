"""The exception barrier around one robot, with adapters that fail in every way."""

import asyncio
import contextlib
import itertools

import pytest

from fleet.clock import SystemClock
from fleet.errors import Fault, LinkLost, LinkRefused, NotReady
from fleet.host.robot import adapter_runner as runners
from fleet.host.robot.adapter_health import AdapterHealth
from fleet.host.robot.adapter_runner import AdapterRunner
from fleet.host.robot.robot_handle import RobotHandle
from fleet.host.runtime.blocking_calls import BlockingCalls
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.model.health import Health, Level
from fleet.robot_config import Limits
from fleet.supervisor.client import SupervisorClient


class Panic(BaseException):
    """As libraries written in Rust raise."""


class Stage:
    """A runner whose adapter does, run by run, what the test says; the last is done for ever."""

    def __init__(self, bench, *runs):
        self.bench = bench
        self.runs = itertools.chain(runs, itertools.repeat(runs[-1]))
        self.made = []
        self.waited = []
        self.rounds = 0
        self.broken = None  # what making an adapter raises
        self.scheduler = TickScheduler(asyncio.get_running_loop(), SystemClock())
        self.reports = []
        self.levels = []
        self.runner = AdapterRunner(
            bench.controller,
            make=self.make,
            handle=self.handle,
            waits=self.waits,
            clock=bench.clock,
            changed=lambda: None,
            level_changed=self.levels.append,
        )
        motion = bench.controller.motion
        motion._crashed = motion.driving._crashed = self.runner.crashed
        motion.executor._crashed = self.runner.crashed
        bench.controller.detach("")

    def make(self, robot):
        if self.broken is not None:
            raise self.broken
        adapter = type(self.bench.adapter)(self.bench.config, robot)
        adapter.calls = self.bench.adapter.calls
        adapter.run = self.counted(next(self.runs), robot)
        self.bench.adapter = adapter
        self.made.append(adapter)
        return adapter

    def counted(self, run, robot):
        async def counted():
            self.robot = robot
            await run(robot)

        return counted

    def handle(self, runner):
        return RobotHandle(
            "rex",
            limits=Limits(),
            state={},
            calls=BlockingCalls("rex"),
            clock=self.bench.clock,
            scheduler=self.scheduler,
            shared=SharedResources(),
            publish=self.reports.append,
            healthy=runner.healthy,
            lost_authority=self.bench.controller.authority_lost,
            latched=lambda: False,
            lacking={},
            circled=self.bench.controller.guard.circles,
            failed=runner.crashed,
            supervised=SupervisorClient(),
        )

    def waits(self):
        self.rounds += 1

        def grow():
            for number in itertools.count():
                self.waited.append(number)
                yield 0.001

        return grow()


@pytest.fixture
async def stage(bench):
    stages = []

    def make(*runs):
        one = Stage(bench, *runs)
        stages.append((one, asyncio.create_task(one.runner.run())))
        one.task = stages[-1][1]
        return one

    yield make
    for one, task in stages:
        for adapter in one.made:
            adapter.go.set()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def serve(robot):
    robot.health(Health())
    await asyncio.Event().wait()


def fail(error):
    async def run(robot):
        raise error

    return run


@pytest.mark.parametrize("error", [LinkLost("the cable came out"), NotReady("booting")])
async def test_a_lost_link_is_opened_again_after_growing_waits(stage, requests, error):
    one = stage(fail(error))
    await requests.until(lambda: len(one.waited) > 4)
    assert one.runner.health == Health(Level.OFFLINE, str(error))
    assert one.waited[:4] == [0, 1, 2, 3]


async def test_a_velocity_that_raises_what_no_future_takes_ends_the_run(stage, requests, bench):
    one = stage(serve, lambda robot: asyncio.Event().wait())
    await requests.until(lambda: one.runner.health == Health())
    bench.adapter.raises = StopIteration()
    answers = bench.request(requests.setpoint())
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert "StopIteration" in one.runner.health.cause
    assert not answers[0].ok


async def test_a_task_groups_lost_link_is_a_lost_link(stage, requests):
    async def run(robot):
        async with asyncio.TaskGroup() as group:
            group.create_task(fail(LinkLost("the cable came out"))(robot))

    one = stage(run)
    await requests.until(lambda: len(one.made) > 4)
    assert one.runner.health == Health(Level.OFFLINE, "the cable came out")


@pytest.mark.parametrize("error", [LinkRefused("no such port"), Fault("the frame is cracked")])
async def test_what_only_a_person_can_mend_is_a_fault_and_tried_slowly(stage, requests, error):
    one = stage(fail(error))
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    await requests.settle()
    assert (one.waited, len(one.made)) == ([], 1)


async def test_a_crash_long_ago_does_not_hasten_what_a_person_must_mend(stage, requests):
    one = stage(fail(ZeroDivisionError("oops")), fail(LinkRefused("no such port")))
    await requests.until(lambda: one.runner.health == Health(Level.FAULT, "no such port"))
    await requests.settle()
    assert len(one.made) == 2


async def test_the_waits_begin_anew_after_a_stable_run(stage, requests, bench):
    async def long(robot):
        bench.clock.advance(runners.SLOW_RETRY + 1)
        raise LinkLost("gone")

    one = stage(fail(LinkLost("x")), fail(LinkLost("y")), long, serve)
    await requests.until(lambda: one.runner.health == Health())
    assert one.waited == [0, 1, 0]


async def test_three_failures_in_a_minute_are_a_quarantine_until_a_person_lifts_it(stage, requests, caplog):
    one = stage(*[fail(ZeroDivisionError("oops"))] * 3, serve)
    await requests.until(lambda: "quarantined" in one.runner.health.cause)
    await asyncio.sleep(0.02)
    assert len(one.made) == 3
    assert "restart_adapter" in one.runner.health.cause
    assert caplog.text.count("Traceback") == 3
    one.runner.restart()
    await requests.until(lambda: one.runner.health == Health())


async def test_requests_to_a_quarantined_robot_are_refused_with_its_cure(stage, requests, bench):
    one = stage(fail(ZeroDivisionError("oops")))
    await requests.until(lambda: "quarantined" in one.runner.health.cause)
    for request in (requests.setpoint(), requests.command("arm"), requests.goal()):
        reason = bench.request(request)[0].reason
        assert one.runner.health.cause in reason
        assert reason.endswith("fleet send rex restart_adapter")


async def test_a_failure_names_its_place_in_the_adapter(stage, requests):
    one = stage(fail(ZeroDivisionError("oops")))
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert "ZeroDivisionError: oops (test_adapter_runner.py:" in one.runner.health.cause


async def test_failures_that_are_far_apart_are_no_quarantine(stage, requests, bench):
    async def run(robot):
        bench.clock.advance(31)
        raise ZeroDivisionError("oops")

    one = stage(run)
    await requests.until(lambda: len(one.made) > 6)
    assert "quarantined" not in one.runner.health.cause


async def test_an_adapter_that_cannot_be_made_is_a_failure_like_any_other(stage, requests):
    one = stage(serve)
    one.broken = TypeError("bad config")
    one.runner.restart()
    await requests.until(lambda: "quarantined" in one.runner.health.cause)
    assert "bad config" in one.runner.health.cause


async def test_a_run_that_cancels_itself_is_a_failure_not_the_end_of_the_robot(stage, requests):
    async def stray(robot):
        raise asyncio.CancelledError

    one = stage(stray, serve)
    await requests.until(lambda: one.runner.health == Health())
    assert len(one.made) == 2


@pytest.mark.parametrize("error", [SystemExit(3), Panic("gone")])
async def test_a_run_that_raises_no_exception_is_a_failure_not_the_end_of_the_process(stage, requests, error):
    one = stage(fail(error), serve)
    await requests.until(lambda: one.runner.health == Health())
    assert len(one.made) == 2


@pytest.mark.parametrize("error", [SystemExit(3), Panic("gone")])
async def test_an_adapter_whose_making_raises_no_exception_is_tried_again(stage, requests, error):
    one = stage(serve)
    one.broken = error
    one.runner.restart()
    await requests.until(lambda: "quarantined" in one.runner.health.cause)
    one.broken = None
    one.runner.restart()
    await requests.until(lambda: one.runner.health == Health())


@pytest.mark.parametrize("error", [SystemExit(3), Panic("gone"), asyncio.CancelledError()])
async def test_a_stop_that_raises_no_exception_is_halted_and_ends_the_run(stage, requests, bench, error):
    one = stage(serve, lambda robot: asyncio.Event().wait())
    await requests.until(lambda: one.runner.health == Health())
    bench.adapter.stops = error
    answers = bench.request(requests.command("stop"))
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert not answers[0].ok
    assert "halt" in bench.adapter.calls


@pytest.mark.parametrize("error", [SystemExit(3), Panic("gone"), asyncio.CancelledError()])
async def test_a_velocity_and_a_halt_that_raise_no_exception_end_the_run_alone(stage, requests, bench, error):
    one = stage(serve, lambda robot: asyncio.Event().wait())
    await requests.until(lambda: one.runner.health == Health())
    bench.adapter.raises = bench.adapter.halts = error
    answers = bench.request(requests.setpoint())
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert not answers[0].ok


@pytest.mark.parametrize("thread", [False, True])
async def test_a_halt_that_raises_ends_the_run_with_its_cause_in_the_health(
    stage, requests, bench, caplog, thread
):
    one = stage(serve, lambda robot: asyncio.Event().wait())
    await requests.until(lambda: one.runner.health == Health())
    bench.adapter.halts = ZeroDivisionError("oops")
    if thread:
        await asyncio.to_thread(bench.controller.halt)
    else:
        bench.controller.emergency("test")
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert "ZeroDivisionError: oops (conftest.py:" in one.runner.health.cause
    await requests.until(lambda: len(one.made) == 2)
    assert caplog.text.count("Traceback") == 1


async def test_a_halt_that_raises_again_and_again_is_a_quarantine(stage, requests, bench):
    one = stage(serve)
    for run in range(1, runners.MOST_FAILURES + 1):
        await requests.until(lambda run=run: len(one.made) == run and one.runner.health == Health())
        bench.adapter.halts = ZeroDivisionError("oops")
        bench.controller.halt()
    await requests.until(lambda: "quarantined" in one.runner.health.cause)
    assert "fleet send rex restart_adapter" in one.runner.health.cause


async def test_a_robot_that_is_stopped_before_it_began_leaves_nothing(bench):
    stage = Stage(bench, serve)
    task = asyncio.create_task(stage.runner.run())
    await asyncio.sleep(0)
    task.cancel()
    await asyncio.wait({task})
    assert task.cancelled()


async def test_a_person_can_begin_a_run_anew_and_the_robot_is_stopped_first(stage, requests, bench):
    one = stage(serve)
    await requests.until(lambda: one.runner.health == Health())
    bench.request(requests.setpoint())
    one.runner.restart()
    await requests.until(lambda: len(one.made) == 2)
    await requests.until(lambda: one.runner.health == Health())
    await requests.settle()
    assert [call for call in bench.adapter.calls if isinstance(call, str)][-2:] == ["halt", "stop"]
    assert bench.adapter.calls.count("stop") == 1


async def test_a_person_need_not_wait_for_the_slow_retry(stage, requests):
    one = stage(fail(LinkRefused("no such port")), serve)
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    one.runner.restart()
    await requests.until(lambda: one.runner.health == Health())


async def test_a_run_that_is_cancelled_is_not_called_reachable_while_its_link_is_being_closed(
    stage, requests, bench
):
    closing, closed = asyncio.Event(), asyncio.Event()

    @contextlib.asynccontextmanager
    async def slow_link():
        try:
            yield
        finally:
            closing.set()
            await closed.wait()

    async def run(robot):
        await robot.enter(slow_link())
        robot.health(Health())
        await asyncio.Event().wait()

    one = stage(run)
    await requests.until(lambda: one.runner.health == Health())
    one.runner.restart()
    await asyncio.wait_for(closing.wait(), 5)
    assert bench.controller.offline
    closed.set()


# -- the robot is left standing ------------------------------------------------------------------------


async def moving(stage, requests, bench, *runs, error=None):
    """Return a stage whose robot is moving, and the event that ends its first run with an error."""
    end = asyncio.Event()
    error = error or LinkLost("the cable came out")

    async def until_ended(robot):
        robot.health(Health())
        await end.wait()
        raise error

    one = stage(until_ended, *(runs or (serve,)))
    await requests.until(lambda: one.runner.health == Health())
    bench.request(requests.goal())
    await requests.settle()
    return one, end


def last_words(bench):
    return [call for call in bench.adapter.calls if isinstance(call, str)]


async def test_a_robot_that_moves_is_stopped_when_its_run_ends(stage, requests, bench):
    one, end = await moving(stage, requests, bench)
    end.set()
    await requests.until(lambda: len(one.made) == 2)
    assert {"halt", "stop"} <= set(last_words(bench))
    assert bench.reports[-1].message == "the cable came out"


async def test_a_robot_that_was_not_seen_to_stand_after_its_adapter_crashed_is_stopped_when_it_is_back(
    stage, requests, bench
):
    one, _ = await moving(stage, requests, bench)
    first = bench.adapter
    bench.request(requests.command("takeoff"))
    await requests.settle()
    first.raises, first.stops = ValueError("a bug in takeoff"), NotReady("it does not answer")
    first.go.set()
    await requests.until(lambda: len(one.made) == 2 and one.runner.health == Health())
    await requests.settle()
    assert last_words(bench)[-3:] == ["stop", "halt", "stop"]


async def test_a_robot_that_moves_is_halted_though_its_loss_cannot_be_recorded(
    stage, requests, bench, monkeypatch, caplog
):
    one, end = await moving(stage, requests, bench)
    lost, failures = bench.controller.lost, iter([ZeroDivisionError("oops")])

    def lost_with_a_failure(why):
        for failure in failures:
            raise failure
        lost(why)

    monkeypatch.setattr(bench.controller, "lost", lost_with_a_failure)
    end.set()
    await requests.until(lambda: len(one.made) == 2)
    assert {"halt", "stop"} <= set(last_words(bench))
    assert "could not be recorded" in caplog.text


async def test_a_robot_is_halted_and_run_again_though_whoever_watches_its_health_fails(
    stage, requests, bench, monkeypatch
):
    def fail(*_):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(
        runners, "AdapterHealth", lambda log, **_: AdapterHealth(log, changed=fail, level_changed=fail)
    )
    one, end = await moving(stage, requests, bench)
    end.set()
    await requests.until(lambda: len(one.made) == 2 and one.runner.health == Health())
    assert {"halt", "stop"} <= set(last_words(bench))
    assert not one.task.done()


async def test_a_robot_is_run_again_though_the_end_of_its_run_cannot_be_recorded(
    stage, requests, bench, monkeypatch
):
    one, end = await moving(stage, requests, bench)
    first, fail = bench.adapter, ZeroDivisionError("oops")
    monkeypatch.setattr(bench.controller, "lost", lambda _why: (_ for _ in ()).throw(fail))
    end.set()
    await requests.until(lambda: len(one.made) == 2 and one.runner.health == Health())
    assert {"halt", "stop"} <= set(last_words(bench))
    assert bench.controller.attached.adapter is not first


async def test_a_host_stops_though_a_restart_was_asked_at_the_same_moment(stage, requests):
    async def fail(_robot):
        raise Fault("broken")

    one = stage(fail)
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    await requests.settle()
    one.runner.restart()
    one.task.cancel()
    await asyncio.wait({one.task}, timeout=5)
    assert one.task.cancelled()


async def test_nothing_moves_after_a_reconnect_until_it_is_asked(stage, requests, bench):
    one, end = await moving(stage, requests, bench)
    bench.request(requests.setpoint())
    end.set()
    await requests.until(lambda: len(one.made) == 2 and one.runner.health == Health())
    before = len(bench.adapter.calls)
    await asyncio.sleep(0.02)
    await requests.until(lambda: not bench.controller.in_motion)  # its standstill may take one more stop
    assert set(bench.adapter.calls[before:]) <= {"halt", "stop"}


async def test_a_robot_that_moves_is_stopped_when_the_host_stops(stage, requests, bench):
    one, _ = await moving(stage, requests, bench)
    one.task.cancel()
    await asyncio.wait({one.task})
    assert last_words(bench)[-1] == "stop"
    assert one.task.cancelled()


async def test_a_robot_that_we_never_moved_is_left_alone_when_the_host_stops(stage, requests, bench):
    one = stage(serve)
    await requests.until(lambda: one.runner.health == Health())
    one.task.cancel()
    await asyncio.wait({one.task})
    assert bench.adapter.calls == []


async def test_a_robot_whose_adapter_crashes_in_a_command_is_stopped(stage, requests, bench):
    one, _ = await moving(stage, requests, bench)
    bench.adapter.raises = ZeroDivisionError("oops")
    bench.request(requests.command("takeoff"))
    await requests.until(lambda: len(one.made) == 2)
    assert last_words(bench)[-1] == "stop"


async def test_a_host_that_stops_while_a_run_is_ending_still_stops_the_robot(stage, requests, bench):
    one, end = await moving(stage, requests, bench)
    bench.adapter.stops = "never"
    end.set()
    await requests.until(lambda: "stop" in bench.adapter.calls)
    one.task.cancel()
    await requests.settle()
    assert not one.task.done()
    bench.adapter.go.set()
    await asyncio.wait({one.task})
    assert one.task.cancelled()


async def test_nothing_is_begun_while_a_run_is_ending(stage, requests, bench):
    one, end = await moving(stage, requests, bench)
    bench.adapter.stops = "never"
    end.set()
    await requests.until(lambda: "stop" in bench.adapter.calls)
    one.robot.health(Health())
    (answer,) = bench.request(requests.setpoint())
    assert "the cable came out" in answer.reason
    bench.adapter.go.set()


@pytest.mark.parametrize("error", [TimeoutError(), LinkLost(), Fault("")])
async def test_a_run_that_ends_without_a_text_leaves_a_robot_that_cannot_be_reached(
    stage, requests, bench, error
):
    """Text is empty for TimeoutError of asyncio; an empty reason stands for a robot that can be reached."""
    one, end = await moving(stage, requests, bench, error=error)
    bench.adapter.stops = "never"
    end.set()
    await requests.until(lambda: "stop" in bench.adapter.calls)
    (answer,) = bench.request(requests.setpoint())
    assert type(error).__name__ in answer.reason
    bench.adapter.go.set()
    await requests.until(lambda: any(type(error).__name__ in health.cause for health in one.levels))


async def test_a_crash_without_a_text_leaves_a_robot_that_cannot_be_reached(stage, requests, bench):
    one, _ = await moving(stage, requests, bench)
    bench.adapter.stops = "never"
    one.runner.crashed(TimeoutError())
    await requests.until(lambda: "stop" in bench.adapter.calls)
    (answer,) = bench.request(requests.setpoint())
    assert answer.reason == "rex is offline: TimeoutError"
    bench.adapter.go.set()


@pytest.mark.parametrize("level", [Level.OFFLINE, Level.FAULT])
async def test_health_without_a_cause_admits_no_motion(stage, requests, bench, level):
    async def run(robot):
        robot.health(Health(level))
        await asyncio.Event().wait()

    one = stage(run)
    await requests.until(lambda: one.runner.health.level is level and one.made)
    await requests.settle()
    (answer,) = bench.request(requests.setpoint())
    assert "no cause" in answer.reason
    assert "no cause" in one.runner.health.cause


async def test_a_stop_that_never_returns_does_not_hold_up_the_next_run(stage, requests, bench, monkeypatch):
    monkeypatch.setattr("fleet.host.robot.standstill.STOP_TIMEOUT", 0.01)
    one, end = await moving(stage, requests, bench)
    bench.adapter.stops = "never"
    end.set()
    await requests.until(lambda: len(one.made) == 2)
    words = [call for call in bench.adapter.calls if isinstance(call, str)]
    assert "halt" in words[words.index("stop") :]


async def test_a_halt_that_raises_does_not_keep_the_robot_from_its_stop(stage, requests, bench):
    one, end = await moving(stage, requests, bench)
    bench.adapter.halts = ZeroDivisionError("oops")
    end.set()
    await requests.until(lambda: len(one.made) == 2)
    assert last_words(bench)[-1] == "stop"


def deaf_until(free):
    """Make a run that ignores its cancellation until it is free."""

    async def deaf(robot):
        robot.health(Health())
        while not free.is_set():
            try:
                await free.wait()
            except asyncio.CancelledError:
                continue

    return deaf


async def test_a_run_that_ignores_its_end_never_has_a_second_beside_it(stage, requests, bench, monkeypatch):
    monkeypatch.setattr(runners, "LEAVE_WITHIN", 0.01)
    free = asyncio.Event()
    one = stage(deaf_until(free), serve)
    await requests.until(lambda: one.runner.health == Health())
    one.runner.crashed(LinkLost("gone"))
    await requests.until(lambda: "does not end" in one.runner.health.cause)
    one.runner.restart()
    await asyncio.sleep(0.02)
    assert len(one.made) == 1
    free.set()
    await requests.until(lambda: len(one.made) == 2)


async def test_a_host_stops_though_a_run_ignores_its_end(stage, requests, monkeypatch):
    monkeypatch.setattr(runners, "LEAVE_WITHIN", 0.01)
    free = asyncio.Event()
    one = stage(deaf_until(free))
    await requests.until(lambda: one.runner.health == Health())
    one.task.cancel()
    await asyncio.wait({one.task}, timeout=60)
    assert one.task.cancelled()
    assert one.runner.leftover is not None
    free.set()
    await one.runner.leftover


async def test_nothing_is_heard_of_a_run_that_is_over(stage, requests, bench):
    one = stage(fail(LinkLost("gone")), serve)
    await requests.until(lambda: len(one.made) == 2)
    old = one.robot
    one.runner.restart()
    await requests.until(lambda: len(one.made) == 3)
    old.health(Health(Level.FAULT, "a ghost"))
    old.report("a ghost")
    old.authority_lost("a ghost")
    assert (one.reports, one.runner.health.cause) == ([], "")


# -- blocking the loop, and the neighbours ------------------------------------------------------------------


async def test_a_robot_that_blocks_the_loop_three_times_is_quarantined_with_the_advice(stage, requests):
    one = stage(serve)
    await requests.until(lambda: one.runner.health == Health())
    one.runner.blocked("rex.py:7 in poll", 0.3)
    assert one.runner.health == Health(Level.DEGRADED, "blocked the event loop at rex.py:7 in poll")
    one.runner.blocked("rex.py:7 in poll", 0.3)
    one.runner.blocked("rex.py:7 in poll", 0.3)
    await requests.until(lambda: "quarantined" in one.runner.health.cause)
    assert "worker: rex" in one.runner.health.cause


async def test_a_block_does_not_make_an_offline_robot_look_alive(stage, requests):
    async def silent(robot):
        await asyncio.Event().wait()

    one = stage(silent)
    await requests.settle()
    one.runner.blocked("rex.py:7 in poll", 0.3)
    assert one.runner.health.level is Level.OFFLINE


async def test_a_robot_that_fails_for_ever_does_not_disturb_another(stage, requests, make_bench):
    bad = stage(fail(LinkLost("x")))
    good = Stage(make_bench(), serve)
    task = asyncio.create_task(good.runner.run())
    await requests.until(lambda: len(bad.made) > 50)
    assert (len(good.made), good.runner.health) == (1, Health())
    task.cancel()
    await asyncio.wait({task})


async def test_a_robot_that_stays_away_is_reported_as_an_error_once(stage, requests, caplog):
    async def silent(robot):
        raise LinkLost(f"nothing received for {len(one.made)} s")

    one = stage(silent)
    await requests.until(lambda: len(one.made) > 5)
    assert [record.message for record in caplog.records if record.levelname == "WARNING"] == [
        "offline: nothing received for 1 s"
    ]


async def test_a_fault_that_a_robot_tells_itself_leaves_it_reachable(stage, requests):
    async def run(robot):
        robot.health(Health(Level.FAULT, "a leg is loose"))
        await asyncio.Event().wait()

    one = stage(run)
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert one.runner.controller.offline == ""


async def test_a_fault_that_ended_the_run_leaves_nobody_to_ask(stage, requests):
    one = stage(fail(Fault("the frame is cracked")))
    await requests.until(lambda: one.runner.health.level is Level.FAULT)
    assert one.runner.controller.offline


def warnings(caplog):
    return [record.message for record in caplog.records if record.levelname == "WARNING"]


async def test_the_steps_of_a_start_are_no_warnings(stage, requests, caplog):
    async def run(robot):
        robot.health(Health(Level.OFFLINE, "it has not spoken yet"))
        robot.health(Health(Level.DEGRADED, "it is being set up"))
        robot.health(Health())
        await asyncio.Event().wait()

    one = stage(run)
    await requests.until(lambda: one.runner.health.level is Level.OK)
    assert warnings(caplog) == []


async def test_a_robot_that_does_not_come_up_is_reported_as_an_error(stage, requests, caplog, monkeypatch):
    monkeypatch.setattr("fleet.host.robot.adapter_health.COMING_UP", 0.05)

    async def run(robot):
        robot.health(Health(Level.OFFLINE, "it has not spoken yet"))
        await asyncio.Event().wait()

    stage(run)
    await requests.until(lambda: warnings(caplog) == ["offline: it has not spoken yet"])


async def test_what_goes_wrong_once_a_robot_was_well_is_reported_at_once(stage, requests, caplog):
    async def run(robot):
        robot.health(Health())
        robot.health(Health(Level.DEGRADED, "its battery is low"))
        await asyncio.Event().wait()

    stage(run)
    await requests.until(lambda: warnings(caplog) == ["degraded: its battery is low"])


async def test_a_fault_during_the_start_is_reported_at_once(stage, requests, caplog):
    async def run(robot):
        robot.health(Health(Level.FAULT, "a leg is loose"))
        await asyncio.Event().wait()

    stage(run)
    await requests.until(lambda: warnings(caplog) == ["fault: a leg is loose"])


class Kept(SupervisorClient):
    """A supervisor that keeps every halt."""

    def register(self, robot, descriptor, frames, address=None, *, kept):
        kept()
        return True


class Line:
    """A link that is open."""

    def fileno(self):
        return 1


async def serve_with_a_halt_left(robot):
    robot._supervised = Kept()
    robot.leave_halt(Line(), [b"halt"])
    await serve(robot)


@pytest.mark.parametrize(
    ("failsafe", "run", "health"),
    [("", serve, "degraded"), ("", serve_with_a_halt_left, "ok"), ("its own", serve, "ok")],
)
async def test_a_robot_that_nothing_stops_when_its_process_dies_is_degraded(  # noqa: PLR0917 - by name
    stage, requests, bench, failsafe, run, health
):
    type(bench.adapter).failsafe = failsafe
    try:
        one = stage(run)
        await requests.until(lambda: one.runner.health.level is not Level.OFFLINE)
        assert one.runner.health.level.word == health
        assert ("nothing stops it" in one.runner.health.cause) is (health == "degraded")
    finally:
        type(bench.adapter).failsafe = "it moves nothing"


class Refusing(SupervisorClient):
    """A supervisor that never answers for a halt."""

    def register(self, robot, descriptor, frames, address=None, *, kept):
        return True


async def test_a_robot_whose_halt_the_supervisor_refused_is_degraded_within_two_seconds(
    stage, requests, bench, monkeypatch
):
    monkeypatch.setattr("fleet.host.robot.robot_handle.KEPT_WITHIN", 0.0)
    monkeypatch.setattr(type(bench.adapter), "failsafe", "")

    async def run(robot):
        robot._supervised = Refusing()
        robot.leave_halt(Line(), [b"halt"])
        await serve(robot)

    one = stage(run)
    await requests.until(lambda: one.runner.health.level is Level.OK)
    bench.clock.advance(0.1)
    one.robot._look_at_halt()
    assert "nothing stops it" in one.runner.health.cause
