"""One camera whose pictures are taken one after the other, for video."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Generator

from fleet.camera.picture import TIMEOUT, Picture, take_picture, taken
from fleet.camera.v4l2 import frames


class Camera:
    """A source like that of ``take_picture``; a V4L2 device is open from its first picture to ``close``."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._frames: Generator[bytes] | None = None
        self._reading = threading.Lock()  # a read that nobody waits for any more may still be under way

    async def picture(self) -> Picture:
        """Return the next picture; raises like ``take_picture``."""
        if self.source.startswith("v4l2:"):
            return await taken(self._next, self.source)
        return await take_picture(self.source)

    async def close(self) -> None:
        """Let go of the device, once a read that is under way has ended."""
        await asyncio.to_thread(self._close)

    def _next(self) -> bytes:
        """Return the device's next frame; after a failure it is opened anew."""
        with self._reading:
            if self._frames is None:
                self._frames = frames(self.source.partition(":")[2], TIMEOUT)
            try:
                return next(self._frames)
            except OSError:
                self._frames = None
                raise

    def _close(self) -> None:
        """Close the device."""
        with self._reading:
            if self._frames is not None:
                self._frames.close()
                self._frames = None
