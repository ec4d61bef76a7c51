"""Rehearsals of a running edge: started by the command line, kept, and needed where the mission says so."""

import asyncio
import contextlib
import json
import sys

import pytest

from fleet.host.edge import rehearsals
from fleet.spool.state_folder import state_folder

HERE = {"worker": "main", "stands": True, "start": [0, 0, 0]}
PATROL = {
    "version": 1,
    "inputs": {"rounds": {"type": "integer", "default": 1}},
    "roles": {"eye": {"from": "rex"}},
    "steps": [
        {"id": "go", "do": {"eye": "walk"}},
        {"id": "rest", "wait": "60 s"},
    ],
    "rehearse": "required",
}


@pytest.fixture
def ready(yard, run_edge, requests):
    """Run an edge with two robots and a mission for one of them, once they answer."""
    place = yard(rex=HERE, max=HERE | {"start": [0, 5, 0]})
    place.change(missions={"patrol": PATROL})

    @contextlib.asynccontextmanager
    async def ready(**parts):
        place.change(**parts)
        edge = place.edge()
        async with run_edge(edge):
            await requests.until(lambda: all(state.position for state in edge.states()))
            yield place, edge

    return ready


async def test_a_mission_that_must_be_rehearsed_is_started_after_a_pass_alone(ready, fleet):
    async with ready() as (place, _):
        code, _, err = await fleet("mission", "run", "patrol")
        assert code == 5
        assert "it must be rehearsed first, and it has not been rehearsed with these inputs" in err
        assert "(fleet mission rehearse patrol)" in err
        code, out, err = await fleet("mission", "rehearse", "patrol", "--json")
        result = json.loads(out)
        assert (code, result["passed"], result["outcome"]) == (0, True, "completed")
        assert [robot["played_by"] for robot in result["robots"]] == [
            "stand-in that stands where the robot is",
            "kinematic stand-in: toy has no simulator that runs in simulated time",
        ]
        assert "rex begins walk (step go)" in err
        assert place.words() == ["run", "run"], "no robot is told anything, and none is run anew"
        assert (await fleet("mission", "run", "patrol", "--detach"))[0] == 0
        code, _, err = await fleet("mission", "rehearse", "patrol")
        assert (code, "rex: it is in run" in err) == (5, True)
        code, _, err = await fleet("mission", "run", "patrol", "rounds=2")
        assert code == 5
        assert place.words("rex").count("walk") == 1


async def test_a_pass_outlives_the_edge_but_not_a_change_of_fleet_yaml(ready, fleet, requests):
    async with ready() as (place, _):
        assert (await fleet("mission", "rehearse", "patrol"))[0] == 0
    kept = state_folder(place.id) / rehearsals.PASSES
    assert kept.stat().st_mode & 0o777 == 0o600
    assert json.loads(kept.read_text())["format"] == rehearsals.FORMAT
    async with ready() as (_, edge):
        assert (await fleet("mission", "run", "patrol", "--detach"))[0] == 0
        assert (await fleet("mission", "abort"))[0] == 0
        await requests.until(lambda: not edge.missions.runs.all())
    async with ready(defaults={"limits": {"speed": 0.5}}):
        code, _, err = await fleet("mission", "run", "patrol")
        assert (code, "fleet.yaml has changed since the rehearsal" in err) == (5, True)


def test_passes_that_cannot_be_read_are_none(tmp_path, caplog):
    kept = tmp_path / rehearsals.PASSES
    assert rehearsals.read_passes(kept) == []
    assert caplog.text == ""
    for damaged in ("[{}]", "{}", '{"passes": []}'):
        kept.write_text(damaged)
        assert rehearsals.read_passes(kept) == []
        assert "missions must be rehearsed again" in caplog.text
        caplog.clear()
    kept.write_text('{"format": 99, "passes": []}')
    assert rehearsals.read_passes(kept) == []
    assert "it has format 99, of a newer fleet; this one reads up to format 1" in caplog.text


def test_passes_from_before_the_format_number_are_read(tmp_path):
    kept = tmp_path / rehearsals.PASSES
    passed = {"mission": "patrol", "program": "a", "config": "b", "roles": {"eye": ["rex"]}}
    passed |= {"places": {"rex": [1.0, 2.0, 0.0]}, "stamp": 5.0}
    kept.write_text(json.dumps([passed]))
    (before,) = rehearsals.read_passes(kept)
    assert (before.mission, before.places) == ("patrol", {"rex": (1.0, 2.0, 0.0)})
    kept.write_text(json.dumps({"format": 1, "passes": [passed]}))
    assert rehearsals.read_passes(kept) == [before]


async def test_a_rehearsal_that_fails_keeps_no_pass(ready, fleet):
    steps = [{"id": "go", "do": {"eye": {"goto": [9, 9]}}}]
    fence = {"inclusion": [[[-1, -1], [1, -1], [1, 1], [-1, 1]]]}
    mission = PATROL | {"steps": steps}
    async with ready(missions={"patrol": mission}, defaults={"fence": fence}):
        code, out, _ = await fleet("mission", "rehearse", "patrol")
        assert (code, "rehearsal of patrol: not passed (failed)" in out) == (8, True)
        assert "fence" in out
        assert (await fleet("mission", "run", "patrol"))[0] == 5


async def test_a_process_that_dies_is_reported_with_its_last_words(ready, fleet, monkeypatch):
    monkeypatch.setattr(rehearsals, "COMMAND", (sys.executable, "-c", "print('no room left')"))
    async with ready():
        code, _, err = await fleet("mission", "rehearse", "patrol")
        assert (code, "it cannot be rehearsed: its process ended: no room left" in err) == (5, True)
        monkeypatch.setattr(rehearsals, "COMMAND", ("/no/such/program",))
        code, _, err = await fleet("mission", "rehearse", "patrol")
        assert (code, "its process cannot be started" in err) == (5, True)


async def test_one_rehearsal_at_a_time_and_none_for_which_nobody_waits(ready, fleet, monkeypatch, requests):
    monkeypatch.setattr(rehearsals, "COMMAND", (sys.executable, "-c", "import time; time.sleep(300)"))
    async with ready() as (_, edge):
        waits = asyncio.create_task(fleet("mission", "rehearse", "patrol"))
        await requests.until(lambda: edge.missions.rehearsals._now is not None)
        code, _, err = await fleet("mission", "rehearse", "patrol")
        assert (code, "another rehearsal is under way" in err) == (5, True)
        monkeypatch.setattr(rehearsals, "UNHEARD", 0.0)
        code, _, err = await waits
        assert (code, "its progress is no longer requested" in err) == (5, True)
        monkeypatch.setattr(rehearsals, "UNHEARD", 60.0)
        monkeypatch.setattr(rehearsals, "SILENT", 0.0)
        code, _, err = await fleet("mission", "rehearse", "patrol")
        assert (code, "its process said nothing for 0 s" in err) == (5, True)
