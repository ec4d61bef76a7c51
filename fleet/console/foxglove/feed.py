"""The live view of a console: listens to the buses while there are viewers, and serves them.

A robot's reports are published only while there is a subscriber, so there is no subscription without a
viewer. The bytes on the links and the history of the edges are not part of the view.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from starlette.websockets import WebSocket

from fleet.bus.bus import Bus
from fleet.clock import Clock
from fleet.console.foxglove.channels import Channels, Sample
from fleet.console.foxglove.protocol import PROTOCOLS
from fleet.console.foxglove.tokens import Tokens
from fleet.console.foxglove.viewer import Viewer
from fleet.record.recorded_keys import REPORTS, published, requested_first

log = logging.getLogger(__name__)

MOST_VIEWERS = 8
POLL_INTERVAL = 0.25  # s between checks of the joined edges
ANSWER_WITHIN = 2.0  # s for the first states
TRY_AGAIN_LATER = 1013  # close code: overloaded


class _SubscribedBus:
    """A subscribed bus, with the functions that unsubscribe."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.ends: list[Callable[[], None]] = []

    def end(self) -> None:
        """Unsubscribe; blocks."""
        for end in self.ends:
            end()


class Feed:
    """``joined`` are the joined buses by edge; ``tokens`` grant access to the view."""

    def __init__(self, joined: Mapping[str, Bus], clock: Clock) -> None:
        self.tokens = Tokens(clock)
        self._joined = joined
        self._clock = clock
        self._session = secrets.token_hex(8)
        self._channels = Channels()
        self._viewers: dict[Viewer, str] = {}  # with their tokens
        self._wanted: frozenset[int] = frozenset()
        self._lock = threading.Lock()
        self._hearing: asyncio.Task[None] | None = None

    async def serve(self, socket: WebSocket, token: str) -> None:
        """Serve a WebSocket with a valid token, until it is closed."""
        spoken = [each for each in PROTOCOLS if each in socket.scope["subprotocols"]]
        if not spoken or not self.tokens.renew(token):
            await socket.close()
            return
        await socket.accept(spoken[0])
        if len(self._viewers) >= MOST_VIEWERS:
            await socket.close(TRY_AGAIN_LATER, f"{MOST_VIEWERS} viewers are connected already; close one")
            return
        viewer = Viewer(socket, self._channels, self._clock, self._count_wanted)
        self._viewers[viewer] = token
        if self._hearing is None:
            self._hearing = asyncio.create_task(self._hear(), name="foxglove:hear")
        try:
            await viewer.run(self._session)
        finally:
            del self._viewers[viewer]
            self._count_wanted()

    def _count_wanted(self) -> None:
        """Update the set of channels with subscribers."""
        self._wanted = frozenset(channel for each in self._viewers for channel in each.wanted)

    async def _hear(self) -> None:
        """Listen to the joined buses until there are no viewers."""
        heard: dict[str, _SubscribedBus] = {}
        loop = asyncio.get_running_loop()
        try:
            while self._viewers:
                for edge, bus in list(self._joined.items()):  # copied, as it may change during a query
                    if edge not in heard or heard[edge].bus is not bus:
                        heard[edge] = _SubscribedBus(bus)
                        await self._begin_guarded(edge, heard[edge], loop)
                for token in self._viewers.values():
                    self.tokens.renew(token)
                await asyncio.sleep(POLL_INTERVAL)
        finally:
            self._hearing = None
            live = [each for edge, each in heard.items() if self._joined.get(edge) is each.bus]
            await asyncio.gather(*(asyncio.to_thread(each.end) for each in live), return_exceptions=True)

    async def _begin_guarded(self, edge: str, heard: _SubscribedBus, loop: asyncio.AbstractEventLoop) -> None:
        """Listen to the bus of an edge; an error there must not affect the other edges."""
        try:
            await asyncio.to_thread(self._begin, edge, heard, loop)
        except Exception:
            log.exception("the live view for Foxglove gets nothing of edge %s", edge)

    def _begin(self, edge: str, heard: _SubscribedBus, loop: asyncio.AbstractEventLoop) -> None:
        """Subscribe on the bus of an edge, and query values that are published rarely; blocks."""
        convert = partial(self._convert, edge, loop)
        control = heard.bus.control
        for key in requested_first(edge):
            convert(control.request(key, b"", timeout=ANSWER_WITHIN))
        for key in published(edge):
            heard.ends.append(control.subscribe(key, lambda key, payload: convert([(key, payload)])))
        heard.ends.append(heard.bus.reports.subscribe_batches(REPORTS, convert))

    def _convert(
        self, edge: str, loop: asyncio.AbstractEventLoop, samples: Iterable[tuple[str, bytes]]
    ) -> None:
        """Convert the samples of an edge's bus; on the bus's threads."""
        received = round(self._clock.time() * 1e9)
        with self._lock:
            found = self._channels.convert(edge, samples, received, self._wanted)
        if found:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(self._offer, found)

    def _offer(self, samples: Sequence[Sample]) -> None:
        """Pass samples to the viewers."""
        for viewer in self._viewers:
            viewer.offer(samples)
