"""A camera that is kept open for a sequence of pictures, for video."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Generator

from fleet.camera.picture import TIMEOUT, Picture, take_in_thread, take_picture
from fleet.camera.v4l2 import frames


class Camera:
    """Pictures of a source as in ``take_picture``; a V4L2 device stays open until ``close``."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._frames: Generator[bytes] | None = None
        self._reading = threading.Lock()  # a read whose caller has timed out may still be running

    async def picture(self) -> Picture:
        """Return the next picture; raises like ``take_picture``."""
        if self.source.startswith("v4l2:"):
            return await take_in_thread(self._next, self.source)
        return await take_picture(self.source)

    async def close(self) -> None:
        """Close the device, once a running read has ended."""
        await asyncio.to_thread(self._close)

    def _next(self) -> bytes:
        """Return the device's next frame; after a failure the device is opened again."""
        with self._reading:
            if self._frames is None:
                self._frames = frames(self.source.partition(":")[2], TIMEOUT)
            try:
                return next(self._frames)
            except Exception:
                self._frames = None
                raise

    def _close(self) -> None:
        """Close the device."""
        with self._reading:
            if self._frames is not None:
                self._frames.close()
                self._frames = None
