import asyncio
import time

import pytest

from fleet.bus import keys
from fleet.model.health import Health, Level
from fleet.model.summary import LARGEST, decode

HERE = {"worker": "main"}


class Heard:
    """The summaries of an edge that came over the bus."""

    def __init__(self, bus_session, edge):
        self.summaries = []
        self.sizes = []
        self.times = []
        self._edge = edge
        bus_session.subscribe(keys.summary("*"), self._take)

    def _take(self, key, payload):
        self.sizes.append(len(payload))
        self.times.append(time.monotonic())
        self.summaries.append(decode(payload, self._edge))


@pytest.fixture
async def served(yard, run_edge, requests):
    place = yard(rex=HERE, max=HERE)
    place.change(edge={"site": "north"})
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        yield place, edge, bus_session
        await asyncio.to_thread(bus_session.close)


async def test_whoever_asks_gets_the_edge_in_one_kilobyte(served):
    place, _, bus_session = served
    ((key, payload),) = await asyncio.to_thread(
        lambda: list(bus_session.request(keys.summary("*"), b"", timeout=60))
    )
    summary = decode(payload, place.id)
    assert key == keys.summary(place.id)
    assert len(payload) <= LARGEST
    assert (summary.site, summary.robots, summary.troubles) == ("north", {"ok": 2}, ())


async def test_a_fault_is_published_within_two_seconds_and_so_is_its_end(served, requests):
    place, edge, bus_session = served
    heard = Heard(bus_session, place.id)
    await requests.until(lambda: heard.summaries)
    robot = edge.process.robots["rex"]
    began = time.monotonic()
    robot.runner.healthy(Health(Level.FAULT, "its gears are stuck"))
    await requests.until(lambda: any(each.troubles for each in heard.summaries))
    took = next(at for at, each in zip(heard.times, heard.summaries, strict=True) if each.troubles) - began
    (trouble,) = next(each for each in heard.summaries if each.troubles).troubles
    assert (trouble.robots, trouble.names, trouble.cause) == (1, ("rex",), "its gears are stuck")
    robot.runner.healthy(Health())
    await requests.until(lambda: not heard.summaries[-1].troubles)
    assert took <= 10.0  # 2 s on a machine that is not busy: the benchmark measures it
    assert max(heard.sizes) <= LARGEST


async def test_nothing_is_published_while_nobody_listens(served, requests):
    _, edge, _ = served
    assert not edge.summaries._publisher.wanted
    await requests.until(lambda: edge.summaries.newest is not None)
    assert edge.summaries._published == ()
