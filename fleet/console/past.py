"""The recordings of a console: the fleet at a past moment, and the numbers of a robot around it."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet.console.moment import moment
from fleet.console.requests import PageSeriesRequest
from fleet.console.series import read_series, require_bounds
from fleet.errors import Refused
from fleet.record.child import EXTRA, is_installed

if TYPE_CHECKING:
    from fleet.record.recorded_folder import RecordedFolder

TRACK = 60.0  # s of a track before the moment
TRACK_POINTS = 30
NOTHING = "nothing is recorded"
HOW = "record: in fleet.yaml records; fleet console --recordings FOLDER shows another recording"


class RecordingReader:
    """The recordings in ``folders``; one moment or window at a time is read, on a thread of its own.

    ``spent`` is the processor time of the calling thread, s.
    """

    def __init__(
        self, folders: Callable[[], Iterable[Path]], spent: Callable[[], float] = time.thread_time
    ) -> None:
        self._folders = folders
        self._spent = spent
        self._known: dict[Path, RecordedFolder] = {}
        self._reading = asyncio.Lock()

    async def extent(self) -> dict[str, float]:
        """Return the time range of the recordings (Unix s); raises Refused if there are none."""
        async with self._reading:
            return await asyncio.to_thread(self._extent)

    async def moment(self, at: float) -> dict[str, Any]:
        """Return the fleet at a moment (Unix s); raises Refused if nothing is recorded, and StateError."""
        if not math.isfinite(at) or not 0 <= at < 1e10:
            raise Refused("this is no valid time")
        async with self._reading:
            return await asyncio.to_thread(self._moment, at)

    async def series(self, requested: PageSeriesRequest) -> dict[str, Any]:
        """Return numbers of a robot in a window, as ``read_series`` does; raises Refused."""
        require_bounds(requested)
        async with self._reading:
            return await asyncio.to_thread(self._series, requested)

    def _extent(self) -> dict[str, float]:
        """Return the time range; blocks."""
        found = [extent for past in self._open_recordings() if (extent := past.extent()) is not None]
        if not found:
            raise Refused(NOTHING, hint=HOW)
        return {"since": min(since for since, _ in found), "until": max(until for _, until in found)}

    def _moment(self, at: float) -> dict[str, Any]:
        """Return the fleet at a moment; blocks."""
        recordings = self._open_recordings()
        found = [message for past in recordings for message in past.at(at)]
        if not found:
            raise Refused(f"{NOTHING} of that time", hint=HOW)
        return moment(
            at, found, [each for past in recordings for each in past.track(at, TRACK, TRACK_POINTS)]
        )

    def _series(self, requested: PageSeriesRequest) -> dict[str, Any]:
        """Return numbers of a robot in a window; blocks."""
        recordings = self._open_recordings()
        from fleet.record.window import Window  # noqa: PLC0415 - its packages are an extra

        window = Window(f"/{requested.robot}/", requested.since, requested.until)
        for past in recordings:
            past.find(window)
        return read_series(requested, window, self._spent)

    def _open_recordings(self) -> list[RecordedFolder]:
        """Return the existing folders of recordings; raises Refused without the extra."""
        if not is_installed():
            raise Refused(EXTRA)
        from fleet.record.recorded_folder import RecordedFolder  # noqa: PLC0415 - its packages are an extra

        there = [folder for folder in self._folders() if folder.is_dir()]
        self._known = {folder: self._known.get(folder) or RecordedFolder(folder) for folder in there}
        return list(self._known.values())
