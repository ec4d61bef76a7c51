"""Read-only requests of a page: history, causes, configuration, recordings, live video."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from fleet.console import commands, configuration
from fleet.console.requests import (
    PageCausesRequest,
    PageConfigRequest,
    PageExtentRequest,
    PageHistoryRequest,
    PageMomentRequest,
    PageSeriesRequest,
    PageVideoRequest,
    VideoAnswered,
)
from fleet.errors import Refused

if TYPE_CHECKING:
    from fleet.console.hub import Hub

Lookup = Callable[[Any], Awaitable[dict[str, object]]]


class Lookups:
    """The read-only requests of one page. ``calls`` return the content of the answer, by kind of request."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._read: set[str] = set()  # what is being read from the recordings
        self.calls: Mapping[type[object], Lookup] = {
            PageCausesRequest: self._causes,
            PageHistoryRequest: self._history,
            PageConfigRequest: self._config,
            PageExtentRequest: self._extent,
            PageMomentRequest: self._moment,
            PageSeriesRequest: self._series,
            PageVideoRequest: self._video,
            VideoAnswered: self._video_answer,
        }

    async def _causes(self, requested: PageCausesRequest) -> dict[str, object]:
        """Return the causes of stops."""
        robots, bus_sessions = (
            self._hub.view.named(requested.robots),
            list(self._hub.edges.bus_sessions().values()),
        )
        return {"causes": await asyncio.to_thread(commands.causes, bus_sessions, robots)}

    async def _history(self, requested: PageHistoryRequest) -> dict[str, object]:
        """Return the history of a robot."""
        bus_sessions = list(self._hub.edges.bus_sessions().values())
        return {"history": await asyncio.to_thread(commands.history, bus_sessions, requested.robot)}

    async def _config(self, requested: PageConfigRequest) -> dict[str, object]:
        """Return the configuration of an edge."""
        bus_sessions = list(self._hub.edges.bus_sessions().values())
        return {"config": await asyncio.to_thread(configuration.fetch, requested.edge, bus_sessions)}

    async def _extent(self, _requested: PageExtentRequest) -> dict[str, object]:
        """Return the time range of the recordings."""
        return {"extent": await self._hub.recordings.extent()}

    async def _moment(self, requested: PageMomentRequest) -> dict[str, object]:
        """Return the fleet at a past moment."""
        with self._one("moment"):
            return {"moment": await self._hub.recordings.moment(requested.at)}

    async def _series(self, requested: PageSeriesRequest) -> dict[str, object]:
        """Return recorded numbers of a robot."""
        with self._one("window"):
            return {"series": await self._hub.recordings.series(requested)}

    @contextlib.contextmanager
    def _one(self, what: str) -> Iterator[None]:
        """Read from the recordings, one of a kind at a time for each page; raises Refused."""
        if what in self._read:
            raise Refused(f"another {what} is still being read for this page")
        self._read.add(what)
        try:
            yield
        finally:
            self._read.discard(what)

    async def _video(self, requested: PageVideoRequest) -> dict[str, object]:
        """Return the next offer of a robot's live video."""
        return {"offer": await self._hub.edges.watched.offers.next(requested.robot)}

    async def _video_answer(self, requested: VideoAnswered) -> dict[str, object]:
        """Forward the page's answer to the program that sends the video."""
        self._hub.edges.watched.answer_offer(requested, self._hub.clock.time())
        return {"done": True}
