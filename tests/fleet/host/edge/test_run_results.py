"""What runs of an edge leave behind: tracks and pictures of their robots, listed by the bus."""

import asyncio
from pathlib import Path

import pytest

from fleet.client import Fleet
from fleet.model.report import PhotoReport
from fleet.wire.databus import encode_report

HERE = {"worker": "main"}
WATCH = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": [{"id": "rest", "wait": "10 min"}]}


@pytest.fixture
async def watched(yard, run_edge, requests):
    """Run an edge whose robot tells its pose and is in a run."""
    place = yard(rex=HERE | {"stands": True}, max=HERE)
    place.change(missions={"watch": WATCH})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        await requests.until(lambda: edge.process.robots["rex"].state().position)
        yield edge


async def test_a_run_leaves_the_tracks_and_pictures_of_its_robots(watched, requests):
    edge, found = watched, []
    rex, other = edge.process.robots["rex"], edge.process.robots["max"]

    def start():
        fleet = Fleet()
        return fleet, fleet.start("watch")

    fleet, run = await asyncio.to_thread(start)
    with fleet:
        picture = PhotoReport(1.0, b"jpeg", "jpeg", 1, 1)
        rex.publish(picture)
        other.publish(picture)  # in no run
        edge.missions.results.picture_receiver(rex.twin)(encode_report(picture, 1))  # as from a worker
        edge.missions.results.picture_receiver(rex.twin)(b"no picture")
        edge.missions.results.record_positions()
        await asyncio.to_thread(run.abort)
        await requests.until(lambda: edge.missions.runs.find(run.id) is None)
        found = await asyncio.to_thread(run.results)
        assert await asyncio.to_thread(lambda: fleet.run(run.id).results()) == found
    assert [(each.kind, each.robot) for each in found] == [("picture", "rex")] * 2 + [("track", "rex")]
    assert found[2].points >= 1
    assert await asyncio.to_thread(Path(found[0].file).read_bytes) == b"jpeg"
