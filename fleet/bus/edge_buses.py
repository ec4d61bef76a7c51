"""The buses of several edges: joins running edges, leaves those that are gone, and rejoins them.

An edge that is away, frozen, or refuses the connection is reported and retried; nothing waits for it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
from pathlib import Path

from fleet.bus.bus import Bus, join
from fleet.bus.settings import BusSettings, running_edges
from fleet.clock import Clock
from fleet.errors import BusError

log = logging.getLogger(__name__)

SCAN_EVERY = 0.25  # s between two scans for running edges
RETRY_AFTER = 2.0  # s until a failed join is retried


class EdgeBuses:
    """The buses that are joined now, by edge, in ``joined``.

    ``edges`` are joined in addition to all edges that run on this computer, or instead of them with ``only``.
    ``opened`` is called in a thread with each edge and its newly joined bus, and may block. ``changed`` is
    called on the event loop with an edge and None when it is joined, or else the reason why it is not.
    """

    def __init__(
        self,
        edges: Iterable[BusSettings],
        directory: Path,
        clock: Clock,
        *,
        only: bool,
        opened: Callable[[str, Bus], None],
        changed: Callable[[str, str | None], None],
    ) -> None:
        self.joined: dict[str, Bus] = {}
        self._edges = {settings.edge: settings for settings in edges}
        self._only = only
        self._directory = directory
        self._clock = clock
        self._opened = opened
        self._changed = changed
        self._joining: dict[str, asyncio.Task[None]] = {}
        self._closing: set[asyncio.Task[None]] = set()
        self._not_before: dict[str, float] = {}

    async def run(self) -> None:
        """Join edges as they start and leave those that are gone, until cancelled."""
        try:
            while True:
                self._scan()
                await asyncio.sleep(SCAN_EVERY)
        finally:
            # Wait for joins in progress, then close them: a thread inside Zenoh must not outlive us.
            await asyncio.gather(*self._joining.values(), return_exceptions=True)
            for edge in list(self.joined):
                self._leave(edge)
            await asyncio.gather(*self._closing, return_exceptions=True)

    def _scan(self) -> None:
        """Start to join running edges that are not joined; leave those that are gone."""
        wanted = self._edges
        running = set(running_edges(self._directory))
        if not self._only:
            wanted = {edge: BusSettings(edge) for edge in running} | wanted
        now = self._clock.monotonic()
        for edge, settings in wanted.items():
            reachable = edge in running or bool(settings.connect)
            if edge in self.joined:
                if not reachable or not self.joined[edge].control.reached():
                    self._leave(edge)
            elif not reachable:
                self._changed(edge, "it does not run")
            elif edge not in self._joining and now >= self._not_before.get(edge, now):
                self._joining[edge] = asyncio.create_task(self._join(settings), name=f"join:{edge}")
        for edge in self.joined.keys() - wanted.keys():
            self._leave(edge)

    def _leave(self, edge: str, why: str = "it has gone") -> None:
        """Close the bus of an edge that is gone; it is joined again when it is back."""
        bus = self.joined.pop(edge)
        self._changed(edge, why)
        closing = asyncio.create_task(asyncio.to_thread(bus.close), name=f"close:{edge}")
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)

    async def _join(self, settings: BusSettings) -> None:
        """Join one edge, or report why it cannot be joined."""
        edge = settings.edge
        try:
            bus = await asyncio.to_thread(join, settings, self._directory)
        except BusError as error:
            self._not_before[edge] = self._clock.monotonic() + RETRY_AFTER
            self._changed(edge, str(error))
        else:
            self.joined[edge] = bus
            self._changed(edge, None)
            await self._open(edge, bus)
        finally:
            del self._joining[edge]

    async def _open(self, edge: str, bus: Bus) -> None:
        """Call ``opened`` in a thread; an edge for which it fails is left and joined again."""
        try:
            await asyncio.to_thread(self._opened, edge, bus)
        except Exception as error:
            log.exception("%s was joined, but nothing can be received from it; it is joined again", edge)
            self._not_before[edge] = self._clock.monotonic() + RETRY_AFTER
            if self.joined.get(edge) is bus:
                self._leave(edge, f"nothing can be received from it: {error}")
