"""Robots of a mission that begin at one instant, or none: on a real bus, in two processes."""

import asyncio
from contextlib import asynccontextmanager

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.requests.stop_cause import local_cause
from fleet.missions.report import MissionStartRequest, RunState, Started

HERE = {"worker": "main", "stands": True, "start": [0, 0, 0]}
THERE = {"worker": "arm", "stands": True, "start": [0, 5, 0]}
ROUTE = [[[1, 8]], [[1, 2]]]
MISSION = {
    "version": 1,
    "roles": {"feet": {"count": 2}},
    "steps": [{"id": "round", "start": "together", "timeout": "60 s", "do": {"feet": {"path": ROUTE}}}],
}
UP = {**MISSION, "steps": [{"id": "up", "start": "together", "do": {"feet": "takeoff"}}]}
LOADED = 2.0  # s by which a busy computer may be late; ``python -m bench together`` measures what it is


class EdgeStartRequester:
    """Who starts the mission of an edge and looks at its runs."""

    def __init__(self, place, bus_session):
        self._place, self._bus_session = place, bus_session

    def start(self, mission="round"):
        request = msgspec.json.encode(MissionStartRequest(run="3f2a", session_id="anna"))
        key, parameters = keys.mission(self._place.id, mission), {"do": "start"}
        ((_, answer),) = self._bus_session.request(key, request, timeout=60, parameters=parameters)
        return msgspec.json.decode(answer, type=Started)

    def run(self):
        found = list(self._bus_session.request(keys.run(self._place.id, "3f2a"), b"", timeout=60))
        return msgspec.json.decode(found[0][1], type=RunState) if found else None


@pytest.fixture
def serve(yard, run_edge, requests):
    """Run an edge with two robots and a mission in which they begin together."""

    @asynccontextmanager
    async def serve(**robots):
        place = yard(**robots)
        place.change(missions={"round": MISSION, "up": UP})
        edge = place.edge()
        async with run_edge(edge):
            await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
            await requests.until(lambda: all(state.placement is not None for state in edge.states()))
            bus_session = await asyncio.to_thread(place.bus_session)
            try:
                yield place, edge, EdgeStartRequester(place, bus_session)
            finally:
                await asyncio.to_thread(bus_session.close)

    return serve


def begun(place):
    """Return who has begun, and when (monotonic s)."""
    return {robot: at for robot in ("rex", "arm") for _, at, word in place.calls(robot) if word == "navigate"}


async def phase(asker, phase):
    """Wait until the run is in a phase; return its state."""
    for _ in range(400):
        state = await asyncio.to_thread(asker.run)
        if state is not None and state.phase == phase:
            return state
        await asyncio.sleep(0.05)
    raise AssertionError(f"waited for {phase}: {await asyncio.to_thread(asker.run)}")


async def test_all_begin_at_one_instant_in_whatever_process_they_are(serve, requests):
    async with serve(rex=HERE, arm=THERE) as (place, _, asker):
        started = await asyncio.to_thread(asker.start)
        assert (started.run, started.refusal) == ("3f2a", "")
        await requests.until(lambda: len(begun(place)) == 2)
        first, last = sorted(begun(place).values())
        assert last - first < LOADED


async def test_one_that_cannot_begin_keeps_the_others_from_it(serve):
    async with serve(rex={**HERE, "fix": False}, arm=THERE) as (place, _, asker):
        await asyncio.to_thread(asker.start, "up")
        state = await phase(asker, "ended")
        assert (state.outcome, "takeoff" in place.words()) == ("failed", False)
        assert "rex cannot: not ready: gps: no fix" in state.reason
        assert "no robot moved" in state.reason


async def test_a_stop_of_one_before_the_instant_keeps_all_from_it(serve):
    async with serve(rex=HERE, arm=THERE) as (place, edge, asker):
        await asyncio.to_thread(asker.start)
        await phase(asker, "step")
        edge.process.stop_robots(("rex",), local_cause("", "test"))
        state = await phase(asker, "ended")
        assert (state.outcome, begun(place)) == ("failed", {})
