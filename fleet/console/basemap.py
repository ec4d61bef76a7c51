"""The map under the robots: pictures from an archive on this computer, and where the site is on them.

Read with ``pmtiles`` from a file that fleet.yaml names (``console.map``); nothing comes from a network. What
is wrong with the archive costs the picture, never the console.
"""

from __future__ import annotations

import asyncio
import logging
import zlib
from pathlib import Path
from typing import Any

from pmtiles.reader import MmapSource, Reader

from fleet.clock import Clock
from fleet.config.basemap import MEDIA_TYPES, archive_problem
from fleet.console.files import PageFile
from fleet.console.task import Basemap
from fleet.runtime.rate_limited_counter import RateLimitedCounter

log = logging.getLogger(__name__)

LARGEST = 2 * 1024 * 1024  # bytes of one picture
DEEPEST = 24  # the zoom at which a picture shows less than a metre
LONGEST_ATTRIBUTION = 300  # characters
_BROKEN = (ValueError, LookupError, TypeError, AttributeError, EOFError, OSError, zlib.error, OverflowError)
"""What ``pmtiles`` raises for an archive that is cut or damaged."""


class MapTiles:
    """Serves the pictures of one archive; ``told`` is what a page must know to place them."""

    def __init__(self, basemap: Basemap, clock: Clock) -> None:
        self.told: dict[str, Any] = {"origin": basemap.origin}
        self._failed = RateLimitedCounter(log, clock)
        self._media_type = ""
        self._reader: Reader | None = None
        try:
            self._open(Path(basemap.path))
        except _BROKEN as error:
            log.warning("the map %s cannot be shown: %s", basemap.path, error)

    def _open(self, path: Path) -> None:
        """Open the archive; raises what is wrong with it."""
        with path.open("rb") as file:
            source = MmapSource(file)
        head = source(0, 127)
        if problem := archive_problem(head):
            raise ValueError(problem)
        reader = Reader(source)
        header = reader.header()
        least, most = int(header["min_zoom"]), int(header["max_zoom"])
        if not 0 <= least <= most <= DEEPEST:
            raise ValueError(f"its zooms are {least} to {most}")
        words = str(reader.metadata().get("attribution", ""))[:LONGEST_ATTRIBUTION]
        self.told |= {"zooms": [least, most], "attribution": words}
        self._media_type = MEDIA_TYPES[head[99]]
        self._reader = reader

    async def tile(self, zoom: int, column: int, row: int) -> PageFile | None:
        """Return a picture; None where the archive has none, or none that can be read."""
        if self._reader is None or zoom > DEEPEST or max(column, row) >= 2**zoom:
            return None
        try:
            found = await asyncio.to_thread(self._reader.get, zoom, column, row)
        except _BROKEN as error:
            self._failed.add("", "a picture of the map cannot be read: %s", error)
            return None
        if not found or len(found) > LARGEST:
            return None
        return PageFile(found, self._media_type)
