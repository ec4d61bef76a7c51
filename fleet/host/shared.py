"""Resources that several robots of one process use together (a UDP port, a simulator process)."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, TypeVar

log = logging.getLogger(__name__)

SharedT = TypeVar("SharedT")


class _Held:
    """One open resource: entered and left by a task of its own, because its users come and go."""

    def __init__(self, key: str, make: Callable[[], AbstractAsyncContextManager[Any]]) -> None:
        self.users = 0
        self.ready: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._released = asyncio.Event()
        self._task = asyncio.create_task(self._hold(make), name=f"shared:{key}")

    async def _hold(self, make: Callable[[], AbstractAsyncContextManager[Any]]) -> None:
        """Enter, hand the value to whoever waits, and leave when the last user has gone."""
        try:
            async with make() as value:
                self.ready.set_result(value)
                await self._released.wait()
        except Exception as error:
            if self.ready.done():
                log.exception("a shared resource failed while it was in use")
            else:
                self.ready.set_exception(error)

    async def release(self) -> None:
        """Leave the resource and wait until it is closed."""
        self._released.set()
        if not self.ready.done():
            self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)


class Shared:
    """Opens a resource for its first user and closes it after its last."""

    def __init__(self) -> None:
        self._held: dict[str, _Held] = {}

    @asynccontextmanager
    async def share(
        self, key: str, make: Callable[[], AbstractAsyncContextManager[SharedT]]
    ) -> AsyncIterator[SharedT]:
        """Enter what ``make`` gives, or what is already open under ``key``."""
        held = self._held.get(key)
        if held is None:
            held = self._held[key] = _Held(key, make)
        held.users += 1
        try:
            yield await asyncio.shield(held.ready)
        finally:
            held.users -= 1
            if held.users == 0:
                if self._held.get(key) is held:
                    del self._held[key]
                await held.release()
