"""The schedules of a running edge: on its bus, in its history, and by the command line."""

import asyncio
import contextlib
import json
import queue
import threading
import time
from datetime import UTC, datetime

import pytest

from fleet.model.event import EventKind, EventReport
from fleet.schedules.runner import Schedules, StartResult
from fleet.schedules.store import FiringStore
from tests.tools.waiting import DEADLINE, wait_until

HERE = {"worker": "main"}
DAWN = {"mission": "patrol", "every": 3600.0}
LOW = {"mission": "patrol", "on_event": {"kind": "battery", "robots": ["rex"]}}


PATROL = {
    "version": 1,
    "roles": {"eye": {"from": "rex"}, "feet": {"from": "pack", "count": {"min": 1, "max": 2}}},
    "steps": [{"id": "go", "do": {"all": "walk"}}],
}
WATCH = PATROL | {"steps": [{"id": "rest", "wait": "10 min"}, *PATROL["steps"]]}
REMOTE = {"accepts": {"mission": ["tele"], "command": ["tele"]}}


class Runs:
    """Starts every mission at once."""

    def __init__(self):
        self.wanted = []

    async def start(self, wanted):
        self.wanted.append(wanted)
        return StartResult(f"run-{len(self.wanted)}")

    async def known(self, _key):
        return ""


@pytest.fixture
async def scheduled(yard):
    """Build an edge with two schedules; gives it, and what starts their missions."""
    place = yard(rex=HERE)
    steps = [{"id": "go", "do": {"eye": "walk"}}]
    patrol = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": steps}
    place.change(missions={"patrol": patrol}, schedules={"dawn": DAWN, "low": LOW})
    edge = place.edge()
    edge.schedules.starter = Runs()
    return place, edge, edge.schedules.starter


@pytest.fixture
def listed(fleet):
    """List the schedules of an edge; at its start it may not answer yet."""

    async def listed(*options):
        async with asyncio.timeout(DEADLINE):
            while True:
                code, out, _ = await fleet("schedule", "ls", *options)
                if code == 0:
                    return out

    return listed


async def test_schedules_are_listed_switched_and_started_by_the_command_line(
    scheduled, run_edge, fleet, listed
):
    _, edge, runs = scheduled
    async with run_edge(edge):
        dawn, low = json.loads(await listed("--json"))
        assert (dawn["name"], dawn["enabled"], dawn["trigger"]) == ("dawn", True, "every 3600 s")
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
    scheduled, run_edge, fleet, listed
):
    _, edge, runs = scheduled
    async with run_edge(edge):
        await listed()
        edge.process.history.add("max", EventReport(time.time(), EventKind.BATTERY, "18 %"))
        edge.process.history.add("rex", EventReport(time.time(), EventKind.BATTERY, "17 %"))
        await asyncio.to_thread(wait_until, "it is started", lambda: runs.wanted)
        assert [wanted.schedule for wanted in runs.wanted] == ["low"]
        _, out, _ = await fleet("history", "--json")
        texts = [each["text"] for each in json.loads(out) if each["kind"] == "schedule"]
        assert texts == ["schedule low: fired: rex: 17 %", "schedule low: started as run-1"]


async def test_schedules_that_fail_are_reported_by_the_edge_and_by_the_command_line(
    scheduled, run_edge, fleet, listed, monkeypatch
):
    _, edge, _ = scheduled

    async def fails(_schedules, *_event):
        raise RuntimeError("a bug")

    monkeypatch.setattr(Schedules, "handle_event", fails)
    async with run_edge(edge):
        await listed()
        edge.process.history.add("rex", EventReport(time.time(), EventKind.BATTERY, "17 %"))
        await asyncio.to_thread(wait_until, "it is told", lambda: edge.schedules.problem)
        assert edge.schedules.problem == "no schedule fires any more: RuntimeError: a bug"
        assert edge.state().health == "degraded"
        code, _, err = await fleet("schedule", "run", "dawn")
        assert (code, "a bug" in err) == (5, True)


async def test_a_disk_that_is_slow_does_not_hold_up_the_robots_when_the_edge_ends(
    scheduled, run_edge, listed, monkeypatch
):
    _, edge, _ = scheduled
    close, closed_by = FiringStore.close, []

    def noted(store):
        closed_by.append(threading.current_thread())
        close(store)

    monkeypatch.setattr(FiringStore, "close", noted)
    async with run_edge(edge):
        await listed()
    assert closed_by
    assert threading.current_thread() not in closed_by


async def test_a_robot_whose_emergency_stop_is_set_is_named_to_what_starts_missions(
    scheduled, run_edge, fleet, listed
):
    _, edge, runs = scheduled
    async with run_edge(edge):
        await listed()
        edge.process.robots["rex"].controller.emergency("anna said so")
        await fleet("schedule", "run", "dawn")
        assert runs.wanted[0].without == {"rex": "its emergency stop is set: anna said so"}


async def test_an_edge_whose_schedules_cannot_be_kept_says_so_and_runs(
    scheduled, run_edge, fleet, monkeypatch
):
    from fleet.errors import StateError  # noqa: PLC0415

    def full(*_):
        raise StateError("the disk is full")

    monkeypatch.setattr("fleet.host.edge.schedules.FiringStore", full)
    _, edge, _ = scheduled
    async with run_edge(edge):
        await asyncio.to_thread(wait_until, "it says so", lambda: edge.schedules.problem)
        assert "no schedule fires: the disk is full" in edge.state().cause
        code, _, err = await fleet("schedule", "ls")
        assert (code, "the disk is full" in err) == (5, True)


@pytest.fixture
async def ready(yard, run_edge, requests):
    """Run an edge with three robots and schedules of missions for them, once the robots answer."""

    @contextlib.asynccontextmanager
    async def ready(mission, **schedules):
        place = yard(rex=HERE | REMOTE, max=HERE | REMOTE, ada=HERE | REMOTE)
        place.change(groups={"pack": ["max", "ada"]}, missions={"patrol": mission}, schedules=schedules)
        edge = place.edge()
        async with run_edge(edge):
            await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
            yield place, edge

    return ready


def runs_of(edge):
    """Return the runs of an edge that have ended: who started each, how it ended, and its robots."""
    found = queue.Queue()
    edge.missions.store.ended(100, found.put)
    return {
        about.run: (about.by, about.transport, head.outcome, members) for about, head, members in found.get()
    }


async def test_a_mission_of_two_robots_starts_by_itself_with_the_authority_of_fleet_yaml(ready):
    soon = datetime.fromtimestamp(time.time() + 10, UTC).isoformat()
    async with ready(PATROL, fair={"mission": "patrol", "once": soon}) as (place, edge):
        await asyncio.to_thread(wait_until, "the run has ended", lambda: runs_of(edge))
        ((run, (by, transport, outcome, members)),) = runs_of(edge).items()
        assert (by, transport, outcome) == ("schedule fair", "mission", "completed")
        assert {member.robot: member.outcome for member in members} == dict.fromkeys(
            ("rex", "max", "ada"), "done"
        ), "no robot that obeys only the cloud's operators keeps fleet.yaml out"
        assert place.words().count("walk") == 3
        assert await edge.missions.starter.known("fair@0.000") == ""
        assert edge.missions.store.knows(run)


async def test_a_schedule_that_is_started_by_hand_starts_the_mission(ready, fleet):
    async with ready(PATROL, dawn=DAWN) as (place, edge):
        code, out, err = await fleet("schedule", "run", "dawn")
        assert code == 0, err
        run = out.split()[-1]
        await asyncio.to_thread(wait_until, "the run has ended", lambda: run in runs_of(edge))
        assert place.words().count("walk") == 3


async def test_a_robot_whose_emergency_stop_is_set_is_left_out_and_reported(ready, fleet):
    async with ready(PATROL, dawn=DAWN) as (place, edge):
        edge.process.robots["max"].controller.emergency("anna said so")
        assert (await fleet("schedule", "run", "dawn"))[0] == 0
        await asyncio.to_thread(wait_until, "the run has ended", lambda: runs_of(edge))
        assert "walk" not in place.words("max")
        _, out, _ = await fleet("history", "--json")
        texts = [each["text"] for each in json.loads(out) if each["kind"] == "schedule"]
        assert texts[-1].endswith("; max left out: its emergency stop is set: anna said so")


async def test_a_mission_that_cannot_be_filled_without_a_stopped_robot_is_skipped(ready, fleet):
    async with ready(PATROL, dawn=DAWN | {"busy": "replace"}) as (place, edge):
        edge.process.robots["rex"].controller.emergency("anna said so")
        code, _, err = await fleet("schedule", "run", "dawn")
        assert (code, "role eye needs 1, 0 can: rex: its emergency stop is set" in err) == (5, True)
        assert "walk" not in place.words()
        assert edge.missions.runs.states() == []


@pytest.mark.parametrize("busy", ["skip", "queue", "replace"])
async def test_a_run_in_the_way_is_left_waited_for_or_replaced(ready, fleet, busy):
    async with ready(WATCH, dawn=DAWN | {"busy": busy}) as (_, edge):
        assert (await fleet("schedule", "run", "dawn"))[0] == 0
        (first,) = edge.missions.runs.states()
        code, out, err = await fleet("schedule", "run", "dawn")
        if busy == "replace":
            (second,) = edge.missions.runs.states()
            assert (code, out) == (0, f"dawn: started as {second.run}\n")
            assert runs_of(edge)[first.run][2] == "aborted"
            return
        assert [each.run for each in edge.missions.runs.states()] == [first.run]
        why = f"run {first.run} is in its way" if busy == "skip" else "it waits"
        assert (code, why in err) == (5, True)
        if busy == "queue":
            assert (await fleet("mission", "abort", first.run))[0] == 0
            await asyncio.to_thread(
                wait_until,
                "the one that waited is started",
                lambda: [each.run for each in edge.missions.runs.states()] not in ([], [first.run]),
            )
