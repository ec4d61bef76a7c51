"""Which robots of a process run: each once, none while its configuration changes, and all anew afterwards."""

import asyncio
import types

import pytest

from fleet.host.process.adapter_runs import CHANGES, AdapterRuns


class Robot:
    """A robot whose run goes on until it is cancelled, and then until it is let go."""

    def __init__(self, name="rex"):
        self.name = name
        self.starts = 0
        self.whys = []
        self.heard = []
        self.go = asyncio.Event()
        self.go.set()
        self.runner = types.SimpleNamespace(leftover=None)
        self.controller = types.SimpleNamespace(event_reporter=types.SimpleNamespace(heard=self.heard.append))

    def start(self):
        self.starts += 1
        return asyncio.ensure_future(self._run())

    async def _run(self):
        try:
            await asyncio.Event().wait()
        finally:
            await self.go.wait()

    def stand_by(self, why):
        self.whys.append(why)


@pytest.fixture
async def rex():
    return Robot()


@pytest.fixture
async def runs(rex):
    def again(robot):
        runs.run(robot)

    runs = AdapterRuns(again)
    yield runs
    runs.ending = True
    runs.suspend(rex, "the edge ends")
    await runs.all_ended([rex])


async def settle():
    for _ in range(5):
        await asyncio.sleep(0)


async def test_a_robot_runs_once(runs, rex):
    runs.run(rex)
    runs.run(rex)
    await settle()
    assert (rex.starts, list(runs.tasks), rex.whys) == (1, ["rex"], [])


async def test_a_suspended_robot_stands_by_once_its_run_has_ended(runs, rex):
    runs.run(rex)
    await settle()
    rex.go.clear()
    runs.suspend(rex, "edge barn has its twin")
    await settle()
    assert rex.whys == [], "its run still ends"
    rex.go.set()
    await settle()
    assert (rex.whys, runs.tasks) == (["edge barn has its twin"], {})


async def test_a_robot_that_does_not_run_stands_by_at_once(runs, rex):
    runs.suspend(rex, "edge barn has its twin")
    assert rex.whys == ["edge barn has its twin"]
    runs.run(rex)
    assert rex.starts == 1


async def test_a_robot_that_is_to_run_again_while_its_run_ends_starts_when_it_has(runs, rex):
    runs.run(rex)
    await settle()
    rex.go.clear()
    runs.suspend(rex, "edge barn has its twin")
    runs.run(rex)
    await settle()
    assert rex.starts == 1, "never two runs at a time"
    rex.go.set()
    await settle()
    assert (rex.starts, list(runs.tasks)) == (2, ["rex"])


async def test_a_run_that_ends_is_not_cancelled_again(runs, rex):
    runs.run(rex)
    await settle()
    rex.go.clear()
    runs.suspend(rex, "edge barn has its twin")
    runs.suspend(rex, "edge shed has its twin")
    assert runs.tasks["rex"].cancelling() == 1, "a second time would break off how it ends"
    rex.go.set()
    await settle()
    assert rex.whys == ["edge barn has its twin"]


async def test_a_process_that_ends_starts_no_robot(runs, rex):
    runs.ending = True
    runs.run(rex)
    assert rex.starts == 0


async def test_no_robot_runs_until_all_are_resumed(runs, rex):
    runs.run(rex)
    await settle()
    runs.suspend_all([rex], "the other edge of the pair runs")
    await settle()
    runs.run(rex)
    assert (rex.starts, rex.whys[-1], len(rex.whys)) == (1, "the other edge of the pair runs", 2)
    runs.resume_all([rex])
    assert rex.starts == 2


async def test_a_robot_whose_configuration_changes_does_not_run_until_it_is_resumed(runs, rex):
    runs.run(rex)
    await settle()
    rex.go.clear()
    runs.pause(rex)
    assert rex.heard == [CHANGES]
    await settle()
    assert not runs.is_paused(rex), "its run still ends"
    rex.go.set()
    await settle()
    assert runs.is_paused(rex)
    assert rex.whys == ["its configuration changes"]
    runs.run(rex)
    runs.resume_all([rex])
    assert rex.starts == 1
    runs.resume(rex)
    assert rex.starts == 2
    assert not runs.is_paused(rex)


async def test_a_robot_that_is_gone_is_forgotten_with_its_pause(runs, rex):
    runs.run(rex)
    await settle()
    runs.pause(rex)
    await settle()
    runs.forget(rex)
    assert not runs.is_paused(rex)
    runs.run(rex)
    assert rex.starts == 2, "one of the same name may come"


async def test_all_have_ended_once_none_runs(runs, rex):
    runs.run(rex)
    await settle()
    rex.go.clear()
    runs.suspend(rex, "the edge ends")
    waits = asyncio.ensure_future(runs.all_ended([rex]))
    await settle()
    assert not waits.done()
    rex.go.set()
    await asyncio.wait_for(waits, 20)
    assert (runs.tasks, rex.whys) == ({}, ["the edge ends"])


async def test_a_run_that_ended_by_itself_is_not_waited_for(runs, rex):
    ada = Robot("ada")
    for robot in (rex, ada):
        runs.run(robot)
    await settle()
    runs.tasks["ada"].cancel()
    await settle()
    runs.suspend(rex, "the edge ends")
    await asyncio.wait_for(runs.all_ended([rex, ada]), 20)
    assert rex.whys == ["the edge ends"]


async def test_an_adapter_that_does_not_end_is_waited_for_and_named(runs, rex, caplog):
    left = asyncio.get_running_loop().create_future()
    rex.runner.leftover = left
    waits = asyncio.ensure_future(runs.all_ended([rex, Robot("ada")]))
    await settle()
    assert not waits.done()
    assert "the adapters of rex do not end; they may still control them" in caplog.text
    left.set_result(None)
    await asyncio.wait_for(waits, 20)
