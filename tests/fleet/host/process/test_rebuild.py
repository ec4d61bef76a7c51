"""A robot gets another configuration: by a new run of its adapter, or in part while it may move."""

import asyncio
from types import SimpleNamespace
from typing import Literal

import pytest

from fleet.adapter import Adapter, AdapterConfig
from fleet.errors import LinkRefused
from fleet.host.process.adapter_runs import AdapterRuns
from fleet.host.process.rebuild import BACK_WITHIN, ENDS_WITHIN, hold, rebuild
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.robot_config import Limits
from fleet.testing.clock import JumpingLoop, LoopClock
from tests.fleet.host.field import local_robot

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


async def ends_late(work, seconds):
    """Do some work; when cancelled, go on for some seconds."""
    try:
        await work
    except asyncio.CancelledError:
        await asyncio.sleep(seconds)
        raise


class CartConfig(AdapterConfig):
    adapter: Literal["cart"] = "cart"
    link: str = "memory:cart"
    answers: bool = True
    answers_after: float = 0.0  # s from the start of a run
    ends_after: float = 0.0  # s for which the adapter ignores the end of its run


class Cart(Adapter[CartConfig]):
    Config = CartConfig
    limits = Limits(speed=2.0, yaw_rate=1.0)
    failsafe = "it moves nothing"
    runs = []  # the configurations with which it has run

    async def connect(self):
        self.runs.append(self.config)
        if not self.config.answers:
            raise LinkRefused("the port is taken")
        await ends_late(asyncio.sleep(self.config.answers_after), self.config.ends_after)

    async def run(self):
        await ends_late(asyncio.Event().wait(), self.config.ends_after)

    def drive(self, velocity):
        pass

    async def stop(self, reason):
        pass

    def halt(self):
        pass


def config(**fields):
    return CartConfig(name="rex", twin=TWIN, **fields)


class Yard:
    """One robot that runs, or is about to, in a process that has nothing else."""

    def __init__(self, before):
        loop = asyncio.get_running_loop()
        clock = LoopClock(loop)
        self.scheduler = TickScheduler(loop, clock)
        self.robot = local_robot(before, Cart, clock=clock, scheduler=self.scheduler)
        self.runs = AdapterRuns(again=self._again)
        self.process = SimpleNamespace(runs=self.runs)
        self.time = loop.time

    def _again(self, robot):
        self.runs.run(robot)

    def refuse_others(self):
        """Let the robot raise for any configuration but the one it has."""
        before, configure = self.robot.config, self.robot.configure

        def refuses(new):
            configure(new)
            if new != before:
                raise ValueError("no plan for it")

        self.robot.configure = refuses

    async def rebuild(self, new):
        """Return the trouble, and the seconds that it took."""
        began = self.time()
        return await rebuild(self.process, self.robot, new), self.time() - began


def in_yard(work, *, before=None, runs=True):
    """Return what ``work(yard)`` returns, in time that jumps."""

    async def whole():
        yard = Yard(before or config())
        yard.scheduler.start()
        if runs:
            yard.runs.run(yard.robot)
            await asyncio.sleep(1.0)
        try:
            return await work(yard)
        finally:
            yard.runs.ending = True
            await asyncio.sleep(0)
            yard.scheduler.stop()

    Cart.runs.clear()
    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(whole())


def test_a_rebuilt_robot_runs_once_more_with_the_new_configuration():
    new = config(limits={"speed": 0.5})

    async def work(yard):
        trouble, took = await yard.rebuild(new)
        return trouble, took < 1.0, yard.robot.config, yard.robot.controller.offline

    assert in_yard(work) == ("", True, new, "")
    assert Cart.runs == [config(), new]


def test_a_robot_that_comes_back_late_but_in_time_keeps_its_new_configuration():
    new = config(answers_after=BACK_WITHIN - 1.0)

    async def work(yard):
        trouble, took = await yard.rebuild(new)
        return trouble, round(took), yard.robot.config

    assert in_yard(work) == ("", round(BACK_WITHIN - 1.0), new)


def test_a_robot_that_does_not_come_back_runs_with_its_configuration_of_before():
    async def work(yard):
        trouble, took = await yard.rebuild(config(answers=False))
        await asyncio.sleep(1.0)
        return trouble, round(took), yard.robot.config, yard.robot.controller.offline

    trouble, took, after, offline = in_yard(work)
    assert trouble == "it did not answer within 20 s: the port is taken"
    assert (took, after, offline, Cart.runs[-1]) == (20, config(), "", config())


def test_a_robot_that_was_offline_before_is_not_waited_for():
    away, new = config(answers=False), config(answers_after=100.0)

    async def work(yard):
        trouble, took = await yard.rebuild(new)
        return trouble, took < 1.0, yard.robot.config

    assert in_yard(work, before=away) == ("", True, new)


def test_a_robot_that_refuses_its_configuration_runs_again_with_the_one_before(caplog):
    async def work(yard):
        yard.refuse_others()
        trouble, _ = await yard.rebuild(config(answers_after=1.0))
        await asyncio.sleep(1.0)
        return trouble, yard.robot.config, yard.robot.controller.offline

    assert in_yard(work) == ("it does not take it over: ValueError: no plan for it", config(), "")
    assert "rex does not take its configuration over" in caplog.text


def test_a_robot_whose_adapter_does_not_end_is_neither_changed_nor_run_beside_it():
    clings = config(ends_after=50.0)

    async def work(yard):
        trouble, _ = await yard.rebuild(config())
        return trouble, yard.robot.config, yard.runs.is_paused(yard.robot), yard.robot.state().cause

    trouble, after, paused, cause = in_yard(work, before=clings)
    assert trouble == "its adapter does not end; restart the edge, and give it a worker of its own"
    assert (after, paused, cause, len(Cart.runs)) == (clings, True, trouble, 1)


def test_a_robot_that_neither_answers_nor_ends_its_new_run_is_not_run_beside_it():
    async def work(yard):
        trouble, _ = await yard.rebuild(config(answers_after=100.0, ends_after=50.0))
        return trouble, yard.robot.config, yard.runs.is_paused(yard.robot)

    trouble, after, paused = in_yard(work)
    assert trouble.startswith("it did not answer within 20 s: ")
    assert trouble.endswith("; its adapter does not end; restart the edge, and give it a worker of its own")
    assert (after, paused, len(Cart.runs)) == (config(), True, 2)


def test_a_run_that_does_not_end_in_time_is_reported_and_nothing_is_taken_over():
    async def work(yard):
        yard.runs.tasks["rex"] = asyncio.ensure_future(ends_late(asyncio.Event().wait(), ENDS_WITHIN + 1))
        await asyncio.sleep(0)
        return await yard.rebuild(config(answers_after=1.0)), yard.robot.config

    (trouble, took), after = in_yard(work, runs=False)
    assert (trouble, after) == ("its run does not end; restart the edge", config())
    assert took == pytest.approx(ENDS_WITHIN, abs=0.1)


HOLDS = [
    # the new fields of a robot of at most 1 m/s, whether its adapter can continue: limits in m/s and rad/s
    ({"limits": {"speed": 1.0}}, True, (True, True), (1.0, 1.0)),
    ({"limits": {"speed": 1.0}}, False, (False, False), (1.0, 1.0)),  # nothing new for the host
    ({"limits": {"speed": 0.5}}, True, (True, True), (0.5, 1.0)),
    ({"limits": {"speed": 0.5}}, False, (True, False), (0.5, 1.0)),
    ({"limits": {"speed": 2.0}}, True, (False, False), (1.0, 1.0)),
    ({"limits": {}}, True, (False, False), (1.0, 1.0)),  # the adapter's own 2 m/s would count
    ({"limits": {"speed": 0.5, "yaw_rate": 9.0}}, True, (True, False), (0.5, 1.0)),
    ({"limits": {"speed": 2.0, "yaw_rate": 0.5}}, False, (True, False), (1.0, 0.5)),
]


@pytest.mark.parametrize(("fields", "whole", "came", "limits"), HOLDS)
def test_a_robot_that_may_move_gets_what_is_stricter_and_nothing_looser(fields, whole, came, limits):
    before, new = config(limits={"speed": 1.0}), config(**fields)

    async def work(yard):
        return hold(yard.robot, new, whole=whole), yard.robot.config

    held, after = in_yard(work, before=before, runs=False)
    assert (held.changed, held.complete, held.trouble) == (*came, "")
    assert held.config == after
    over = after.limits.over(Cart.limits)
    assert (over.speed, over.yaw_rate) == limits
    assert (after is new) is held.complete


def test_stricter_settings_that_a_robot_refuses_leave_it_with_those_before():
    async def work(yard):
        before = yard.robot.config
        yard.refuse_others()
        held = hold(yard.robot, config(limits={"speed": 0.5}), whole=True)
        return held, yard.robot.config is before, held.config is before

    held, robot_has, told = in_yard(work, runs=False)
    assert (held.changed, held.complete, robot_has, told) == (False, False, True, True)
    assert held.trouble == "it does not take it over: ValueError: no plan for it"
