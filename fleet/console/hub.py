"""Shared state of all pages of a console: the fleet view, the ticks, the stops and the edges."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import msgspec

from fleet.bus.settings import runtime_dirs
from fleet.clock import Clock
from fleet.console.basemap import MapTiles
from fleet.console.edge_connections import EdgeConnections
from fleet.console.exports import Exports
from fleet.console.fleet_view import FleetView
from fleet.console.foxglove.feed import Feed
from fleet.console.page_connection import PageConnection
from fleet.console.past import RecordingReader
from fleet.console.sessions import ConsoleUser
from fleet.console.stops import StopTarget, StopTracker
from fleet.console.task import ConsoleTask

log = logging.getLogger(__name__)

TICK = 0.1  # s between updates
QUIET = 0.25  # s after which a page gets a message even without news; it shows a silent console after 1 s
DESCRIBE = 10  # ticks between queries of the vocabulary of watched robots
PLANS = 20  # ticks between queries of the missions and schedules
MOST_TABS = 64


class Hub:
    """The view, updated at each tick, and the pages that receive it."""

    def __init__(self, task: ConsoleTask, directory: Path, clock: Clock) -> None:
        self.clock = clock
        self.view = FleetView()
        self.edges = EdgeConnections(task, directory, self.view, clock)
        self.recordings = RecordingReader(task.recordings_now)
        self.tiles = MapTiles(task.basemap, clock) if task.basemap is not None else None
        self.exports = Exports(task.recordings_now)
        self.foxglove = Feed(self.edges.joined, clock)
        self.tabs: set[PageConnection] = set()
        self._stops = StopTracker(self.view, self.edges.bus_sessions, _directories(directory), clock)
        self._tick = asyncio.Event()
        self._count = 0
        # for this tick, by the version from which they start
        self._updates: dict[int, tuple[bytes, int]] = {}

    async def run(self) -> None:
        """Join the edges and update periodically until cancelled."""
        connecting = asyncio.create_task(self.edges.run(), name="edges")
        try:
            while True:
                self.update()
                await asyncio.sleep(TICK)
        finally:
            connecting.cancel()
            await asyncio.gather(connecting, return_exceptions=True)
            self._stops.close()

    def update(self) -> None:
        """Update the view, and wake the pages."""
        self._count += 1
        self.edges.apply_received()
        self._updates.clear()
        watched = {tab.watched for tab in self.tabs} - {""}
        self.edges.watched.watch(watched)
        if self._count % DESCRIBE == 0:
            for robot in watched:
                self.edges.queries.request_description(robot)
        if self.tabs and self._count % PLANS == 0:
            self.edges.queries.request_missions()
            self.edges.queries.request_schedules()
        tick, self._tick = self._tick, asyncio.Event()
        tick.set()

    async def next_tick(self) -> None:
        """Wait for the next tick."""
        await self._tick.wait()

    def updates_since(self, version: int) -> tuple[bytes, int]:
        """Return a message with the changes after a version, and the new version.

        Pages with the same version get the same bytes. Without changes it is a periodic sign of life, else
        empty.
        """
        current = self.view.version
        if version == current and self._count % round(QUIET / TICK):
            return b"", version
        if version not in self._updates:
            update: dict[str, Any] = {
                "type": "news",
                "now": self.clock.monotonic(),
                "time": self.clock.time(),
            }
            self._updates[version] = msgspec.json.encode(update | self.view.since(version)), current
        return self._updates[version]

    def stop(
        self, target: StopTarget, operator: ConsoleUser, why: str, request: str
    ) -> Coroutine[Any, Any, dict[str, Any]]:
        """Stop robots on behalf of an operator."""
        return self._stops.request(target, operator.name, why, request)


def _directories(directory: Path) -> Callable[[], list[Path]]:
    """Return a function that finds the folders with supervisors' sockets: ours, and others of this user."""
    return lambda: list(dict.fromkeys((directory, *runtime_dirs())))
