"""The map under the robots: tiles from an archive on this computer, and the site's position on them.

The archive (PMTiles version 3) is a file named in fleet.yaml (``console.map``); nothing is loaded from a
network. Errors in it affect only the map, never the console, which relays stops: it is read by ``pread`` (a
memory-mapped file that is truncated would kill the process), one tile at a time, and each of its directories
is decoded once, within limits.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import zlib
from functools import lru_cache
from pathlib import Path
from typing import Any

from pmtiles.tile import (
    Compression,
    Entry,
    HeaderDict,
    deserialize_directory,
    deserialize_header,
    find_tile,
    zxy_to_tileid,
)

from fleet.clock import Clock
from fleet.config.basemap import HEAD, MEDIA_TYPES, archive_problem
from fleet.console.files import PageFile
from fleet.console.task import Basemap
from fleet.runtime.rate_limited_counter import RateLimitedCounter

log = logging.getLogger(__name__)

LARGEST = 2 * 1024 * 1024  # bytes of one tile, and of the metadata
LARGEST_DIRECTORY = 512 * 1024  # bytes after decoding; some 80,000 entries
KEPT = 64  # decoded directories in the cache
DEPTH = 4  # directories from the root to a tile, at most
DEEPEST = 24  # the zoom at which a tile covers less than a metre
LONGEST_ATTRIBUTION = 300  # characters
_GZIP = 31  # zlib's window bits for gzip data
_BROKEN = (ValueError, LookupError, TypeError, AttributeError, EOFError, OSError, zlib.error, OverflowError)
"""Exceptions of ``pmtiles`` for a truncated or damaged archive."""


class Archive:
    """An open archive; blocks. All its methods raise the exceptions of ``_BROKEN`` for unreadable data."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        head = self._read(0, HEAD)
        if problem := archive_problem(head):
            raise ValueError(problem)
        self.media_type = MEDIA_TYPES[head[99]]
        self.header: HeaderDict = deserialize_header(head)
        self._directory = lru_cache(KEPT)(self._decoded)

    def metadata(self) -> dict[str, Any]:
        """Return the metadata of the archive."""
        data = self._read(self.header["metadata_offset"], self.header["metadata_length"])
        if self.header["internal_compression"] == Compression.GZIP:
            data = _unzipped(data, LARGEST)
        found = json.loads(data)
        return found if isinstance(found, dict) else {}

    def tile(self, zoom: int, column: int, row: int) -> bytes | None:
        """Return the bytes of a tile, None if there is none."""
        header, number = self.header, zxy_to_tileid(zoom, column, row)
        offset, length = header["root_offset"], header["root_length"]
        for _ in range(DEPTH):
            found = find_tile(self._directory(offset, length), number)
            if found is None:
                return None
            if found.run_length:
                return self._read(header["tile_data_offset"] + found.offset, found.length)
            offset, length = header["leaf_directory_offset"] + found.offset, found.length
        return None

    def _decoded(self, offset: int, length: int) -> list[Entry]:
        """Read a directory."""
        data = self._read(offset, length)
        _unzipped(data, LARGEST_DIRECTORY)  # checks the size, which ``pmtiles`` does not limit
        return deserialize_directory(data)

    def _read(self, offset: int, length: int) -> bytes:
        """Read a part of the file; raises EOFError if it is shorter, ValueError beyond the limit."""
        if length > LARGEST:
            raise ValueError(f"a part of it has {length} bytes")
        data = os.pread(self._file, length, offset)
        if len(data) < length:
            raise EOFError("it ends too soon")
        return data


def _unzipped(data: bytes, most: int) -> bytes:
    """Decompress data; raises ValueError beyond ``most`` bytes."""
    out = zlib.decompressobj(_GZIP).decompress(data, most + 1)
    if len(out) > most:
        raise ValueError(f"a part of it has more than {most} bytes")
    return out


class MapTiles:
    """Serves the tiles of one archive; ``description`` is its placement for pages."""

    def __init__(self, basemap: Basemap, clock: Clock) -> None:
        self.description: dict[str, Any] = {"origin": basemap.origin}
        self._failed = RateLimitedCounter(log, clock)
        self._reading = asyncio.Lock()
        self._archive: Archive | None = None
        try:
            self._open(Path(basemap.path))
        except _BROKEN as error:
            log.warning("the map %s cannot be shown: %s", basemap.path, error)

    def _open(self, path: Path) -> None:
        """Open the archive; raises an exception of ``_BROKEN``."""
        archive = Archive(path)
        least, most = int(archive.header["min_zoom"]), int(archive.header["max_zoom"])
        if not 0 <= least <= most <= DEEPEST:
            raise ValueError(f"its zooms are {least} to {most}")
        words = str(archive.metadata().get("attribution", ""))[:LONGEST_ATTRIBUTION]
        self.description |= {"zooms": [least, most], "attribution": words}
        self._archive = archive

    async def tile(self, zoom: int, column: int, row: int) -> PageFile | None:
        """Return a tile; None if it is missing or unreadable."""
        if self._archive is None or zoom > DEEPEST or max(column, row) >= 2**zoom:
            return None
        try:
            async with self._reading:
                found = await asyncio.to_thread(self._archive.tile, zoom, column, row)
        except _BROKEN as error:
            self._failed.add("", "a picture of the map cannot be read: %s", error)
            return None
        return PageFile(found, self._archive.media_type) if found else None
