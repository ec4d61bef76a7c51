"""The schedules of a running edge: on its bus, in its history, and by the command line."""

import asyncio
import json
import time

import pytest

from fleet.cli.main import main
from fleet.host.edge.schedules import NoMissions
from fleet.model.event import EventKind, EventReport
from fleet.schedules.runner import Begun
from fleet.testing.waiting import wait_until

HERE = {"worker": "main"}
DAWN = {"mission": "patrol", "every": 3600.0}
LOW = {"mission": "patrol", "on_event": {"kind": "battery", "robots": ["rex"]}}


class Runs(NoMissions):
    """Starts every mission at once."""

    def __init__(self):
        self.wanted = []

    async def start(self, wanted):
        self.wanted.append(wanted)
        return Begun(f"run-{len(self.wanted)}")


@pytest.fixture
async def scheduled(yard, run_edge, asks, monkeypatch):
    """Build an edge with two schedules; gives it, and what starts their missions."""
    monkeypatch.setattr("fleet.config.load.check_schedules", lambda *_: None)  # there are no missions yet
    place = yard(rex=HERE)
    place.change(schedules={"dawn": DAWN, "low": LOW})
    edge = place.edge()
    edge.schedules.starter = Runs()
    return place, edge, edge.schedules.starter


@pytest.fixture
def fleet(capsys):
    """Run one command line on a thread; gives its code and what it says."""

    async def fleet(*arguments):
        code = await asyncio.to_thread(main, arguments)
        said = capsys.readouterr()
        return code, said.out, said.err

    return fleet


async def test_schedules_are_listed_switched_and_started_by_the_command_line(scheduled, run_edge, fleet):
    _, edge, runs = scheduled
    async with run_edge(edge):
        code, out, _ = await fleet("schedule", "ls", "--json")
        dawn, low = json.loads(out)
        assert (code, dawn["name"], dawn["enabled"], dawn["trigger"]) == (0, "dawn", True, "every 3600 s")
        assert 0 < dawn["next"] - time.time() <= 3600
        assert (low["trigger"], low.get("next")) == ("on battery of rex", None)
        assert await fleet("schedule", "disable", "dawn") == (0, "dawn: disabled\n", "")
        _, out, _ = await fleet("schedule", "ls")
        assert "off" in out
        assert await fleet("schedule", "run", "dawn") == (0, "dawn: started as run-1\n", "")
        assert runs.wanted[0].mission == "patrol"
        assert (await fleet("schedule", "enable", "dawn"))[0] == 0
        code, _, err = await fleet("schedule", "run", "dwan")
        assert (code, "there is no schedule 'dwan'" in err) == (5, True)


async def test_an_event_of_the_history_fires_and_all_that_happens_is_in_the_history(
    scheduled, run_edge, fleet
):
    _, edge, runs = scheduled
    async with run_edge(edge):
        await fleet("schedule", "ls")  # it is served by now
        edge.process.history.add("max", EventReport(time.time(), EventKind.BATTERY, "18 %"))
        edge.process.history.add("rex", EventReport(time.time(), EventKind.BATTERY, "17 %"))
        await asyncio.to_thread(wait_until, "it is started", lambda: runs.wanted)
        assert [wanted.schedule for wanted in runs.wanted] == ["low"]
        _, out, _ = await fleet("history", "--json")
        told = [each["text"] for each in json.loads(out) if each["kind"] == "schedule"]
        assert told == ["schedule low: fired: rex: 17 %", "schedule low: started as run-1"]


async def test_a_robot_whose_emergency_stop_is_set_is_named_to_what_starts_missions(
    scheduled, run_edge, fleet
):
    _, edge, runs = scheduled
    async with run_edge(edge):
        await fleet("schedule", "ls")
        edge.process.robots["rex"].controller.emergency("anna said so")
        await fleet("schedule", "run", "dawn")
        assert runs.wanted[0].without == {"rex": "its emergency stop is set: anna said so"}


async def test_without_what_starts_missions_a_firing_is_refused_and_told(scheduled, run_edge, fleet):
    _, edge, _ = scheduled
    edge.schedules.starter = NoMissions()
    async with run_edge(edge):
        code, _, err = await fleet("schedule", "run", "dawn")
        assert (code, "this edge carries out no missions" in err) == (5, True)


async def test_an_edge_whose_schedules_cannot_be_kept_says_so_and_runs(
    scheduled, run_edge, fleet, monkeypatch
):
    from fleet.errors import StateError  # noqa: PLC0415

    def full(*_):
        raise StateError("the disk is full")

    monkeypatch.setattr("fleet.host.edge.schedules.Store", full)
    _, edge, _ = scheduled
    async with run_edge(edge):
        await asyncio.to_thread(wait_until, "it says so", lambda: edge.schedules.problem)
        assert "no schedule fires: the disk is full" in edge.state().cause
        code, _, err = await fleet("schedule", "ls")
        assert (code, "the disk is full" in err) == (5, True)
