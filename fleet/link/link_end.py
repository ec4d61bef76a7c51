"""How a link ends: once, with a reason, noticed from any thread."""

from __future__ import annotations

import asyncio
import contextlib

from fleet.errors import LinkLost


class LinkEnd:
    """The end of one open link; made on the loop that the link lives on."""

    def __init__(self, url: str) -> None:
        self.ended = False  # True once the link fell or was closed
        self._url = url
        self._reason = ""
        self._over = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    def error(self) -> LinkLost:
        """Return the error that says why the link ended."""
        return LinkLost(f"{self._url}: {self._reason}")

    def fall(self, reason: str) -> LinkLost:
        """Note the end, from any thread; the first reason stays. Returns the error to raise."""
        if not self.ended:
            self._reason, self.ended = reason, True
            # A loop that has ended has nobody left who waits.
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._over.set)
        return self.error()

    async def wait(self) -> None:
        """Wait for the end, then raise LinkLost."""
        await self._over.wait()
        raise self.error()
