"""End of a link: recorded once, with its reason, from any thread."""

from __future__ import annotations

import asyncio
import contextlib

from fleet.errors import LinkLost


class LinkEnd:
    """End of one open link; created on the event loop of the link."""

    def __init__(self, url: str) -> None:
        self.ended = False  # True once the link is down or closed
        self._url = url
        self._reason = ""
        self._over = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    def error(self) -> LinkLost:
        """Return the error that says why the link ended."""
        return LinkLost(f"{self._url}: {self._reason}")

    def fall(self, reason: str) -> LinkLost:
        """Record the end, from any thread; the first reason is kept. Returns the error to raise."""
        if not self.ended:
            self._reason, self.ended = reason, True
            # RuntimeError: the loop is closed, so nothing waits on it any more.
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._over.set)
        return self.error()

    async def wait(self) -> None:
        """Wait for the end, then raise LinkLost."""
        await self._over.wait()
        raise self.error()
