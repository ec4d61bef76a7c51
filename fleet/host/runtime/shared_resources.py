"""Resources that several robots of one process share (a UDP port, a simulator process)."""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, TypeVar

from fleet.runtime.event_loop import OWNER
from fleet.runtime.exception_barrier import guarded

log = logging.getLogger(__name__)

SharedT = TypeVar("SharedT")


class _OpenResource:
    """One open resource: entered and exited by its own task, because its users come and go."""

    def __init__(self, key: str, make: Callable[[], AbstractAsyncContextManager[object]]) -> None:
        self.users = 0
        self.ready: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self.released = asyncio.Event()
        # A failure or block in shared code must not count against the first user.
        context = contextvars.copy_context()
        context.run(OWNER.set, "")
        loop = asyncio.get_running_loop()
        self.task = loop.create_task(self._hold(make), name=f"shared:{key}", context=context)

    async def _hold(self, make: Callable[[], AbstractAsyncContextManager[object]]) -> None:
        """Serve the resource to its users; those that wait for it get the error if it cannot be opened."""
        try:
            await guarded(lambda: self._serve(make))
        except Exception as error:
            if self.ready.done():
                log.exception("a shared resource failed while it was in use")
            else:
                self.ready.set_exception(error)

    async def _serve(self, make: Callable[[], AbstractAsyncContextManager[object]]) -> None:
        """Enter, pass the value to the waiting users, and exit after the last one."""
        async with make() as value:
            self.ready.set_result(value)
            await self.released.wait()

    async def release(self) -> None:
        """Close the resource and wait for that; cancelling the caller does not cancel the closing."""
        self.released.set()
        if not self.ready.done():
            self.task.cancel()
        await asyncio.wait({self.task})


class SharedResources:
    """Opens a resource for its first user and closes it after its last."""

    def __init__(self) -> None:
        self._held: dict[str, _OpenResource] = {}

    @asynccontextmanager
    async def share(
        self, key: str, make: Callable[[], AbstractAsyncContextManager[SharedT]]
    ) -> AsyncIterator[SharedT]:
        """Enter the resource that is open under ``key``, or open it with ``make``."""
        held = await self._open(key, make)
        held.users += 1
        try:
            yield await asyncio.shield(held.ready)
        finally:
            held.users -= 1
            if held.users == 0:
                await held.release()

    async def _open(self, key: str, make: Callable[[], AbstractAsyncContextManager[object]]) -> _OpenResource:
        """Return the resource under ``key``; if it is being closed, wait and reopen it."""
        while (held := self._held.get(key)) is not None and held.released.is_set():
            await asyncio.wait({held.task})
        if held is None:
            held = self._held[key] = _OpenResource(key, make)
            held.task.add_done_callback(lambda _: self._held.pop(key))
        return held
