"""The Python client: missions and robots of the edges that run."""

import asyncio
import json

import pytest

from fleet.client import Fleet
from fleet.errors import NotRunning, Refused

HERE = {"worker": "main"}
PATROL = {
    "version": 1,
    "inputs": {"rest": {"type": "number", "default": 0.1}},
    "roles": {"eye": {"from": "rex"}},
    "steps": [{"id": "go", "do": {"eye": "walk"}}, {"id": "rest", "wait": {"input": "rest"}}],
}


@pytest.fixture
async def place(yard, run_edge, requests):
    """Run an edge with two robots and a mission."""
    place = yard(rex=HERE, max=HERE)
    place.change(missions={"patrol": PATROL}, groups={"pack": ["rex", "max"]})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        yield place


async def test_a_mission_is_started_and_followed(place):
    def program():
        with Fleet() as fleet:
            run = fleet.start("patrol")
            phases = [state.phase for state in run.follow(every=0.02)]
            return run.roles, phases[-1], fleet.run(run.id).wait(), run.log()

    roles, last, end, log = await asyncio.to_thread(program)
    assert (roles, last, end.outcome) == ({"eye": ["rex"]}, "ended", "completed")
    assert "begins walk" in [line.text for line in log]
    assert place.words("rex").count("walk") == 1


async def test_a_run_is_controlled(place, tmp_path):
    mission = tmp_path / "watch.yaml"
    requests = {"roles": {"eye": {}}, "steps": [{"id": "ask", "ask": {"text": "Go on?"}}]}
    mission.write_text(json.dumps(PATROL | requests))

    def program():
        with Fleet(place.file) as fleet:
            run = fleet.start(str(mission), robots={"eye": ["max"]})
            run.pause()
            with pytest.raises(Refused, match="Go on"):  # it asks, and is paused
                run.pause()
            run.resume()
            run.answer(goes_on=True)
            first = run.wait().outcome
            fleet.start("patrol", rest=600)
            run = fleet.run()
            run.abort()
            return first, run.wait().outcome

    assert await asyncio.to_thread(program) == ("completed", "aborted")


async def test_robots_are_commanded_by_name_and_group(place):
    def program():
        with Fleet() as fleet:
            assert {robot.name for robot in fleet.robots()} == {"max", "rex"}
            done = fleet.send("pack", "walk")
            with pytest.raises(Refused, match="rex: rex has no 'dance'"):
                fleet.send("rex", "dance")
            with pytest.raises(Refused, match="not placed in the site's frame: max"):
                fleet.goto("max", (1, 2))
            with pytest.raises(Refused, match="there is no place 'dock'"):
                fleet.goto("max", "dock")
            fleet.stop("rex")
            fleet.emergency_stop("max")
            with pytest.raises(Refused, match="emergency stop"):
                fleet.send("max", "walk")
            return {name: reply.done for name, reply in done.items()}

    assert await asyncio.to_thread(program) == {"rex": True, "max": True}
    assert "stop" in place.words("rex")


async def test_a_mission_that_nobody_can_fill_is_refused(place):
    def program():
        with Fleet() as fleet:
            fleet.start("patrol", robots={"eye": ["ada"]})

    with pytest.raises(Refused, match="role eye needs 1"):
        await asyncio.to_thread(program)


def test_without_an_edge_nobody_is_reached(yard):
    yard(rex=HERE)
    with pytest.raises(NotRunning, match="no edge is running here"):
        Fleet()
