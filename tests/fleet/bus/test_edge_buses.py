"""The buses of edges that come, go and come back."""

import asyncio
import contextlib
import shutil
import tempfile
from pathlib import Path

import pytest

from fleet.bus import edge_buses
from fleet.bus.bus import open_edge
from fleet.bus.edge_buses import EdgeBuses
from fleet.bus.settings import BusSettings
from fleet.clock import SystemClock
from tests.tools.waiting import DEADLINE


@pytest.fixture
def runtime():
    path = Path(tempfile.mkdtemp(prefix="fc"))
    yield path
    shutil.rmtree(path)


async def test_an_edge_is_joined_when_it_comes_and_left_when_it_goes(runtime):
    changes, opened = asyncio.Queue(), []
    edges = EdgeBuses(
        [BusSettings("yard-1")],
        runtime,
        SystemClock(),
        only=True,
        opened=lambda edge, _bus: opened.append(edge),
        changed=lambda edge, problem: changes.put_nowait((edge, problem)),
    )
    running = asyncio.create_task(edges.run())

    async def wait_for_change(problem):
        while await changes.get() != ("yard-1", problem):
            pass

    async with asyncio.timeout(DEADLINE):
        await wait_for_change("it does not run")
        for _ in range(2):
            bus = await asyncio.to_thread(open_edge, BusSettings("yard-1"), runtime)
            await wait_for_change(None)
            assert list(edges.joined) == ["yard-1"]
            await asyncio.to_thread(bus.close)
            await wait_for_change("it has gone")
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running
    assert (edges.joined, opened) == ({}, ["yard-1", "yard-1"])


async def test_an_edge_from_which_nothing_can_be_received_is_joined_again(runtime, monkeypatch, caplog):
    """Shown as joined, its robots would stay as they were for ever."""
    monkeypatch.setattr(edge_buses, "RETRY_AFTER", 0.0)
    changes, tries = asyncio.Queue(), []

    def opened(edge, _bus):
        tries.append(edge)
        if len(tries) == 1:
            raise RuntimeError("no subscriber")

    edges = EdgeBuses(
        [BusSettings("yard-1")],
        runtime,
        SystemClock(),
        only=True,
        opened=opened,
        changed=lambda _edge, problem: changes.put_nowait(problem),
    )
    bus = await asyncio.to_thread(open_edge, BusSettings("yard-1"), runtime)
    running = asyncio.create_task(edges.run())
    async with asyncio.timeout(DEADLINE):
        assert [await changes.get() for _ in range(3)] == [
            None,
            "nothing can be received from it: no subscriber",
            None,
        ]
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running
    await asyncio.to_thread(bus.close)
    assert "it is joined again" in caplog.text
