"""The broker on a thread of its own, for tests and programs that have no event loop to spare."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Self, TypeVar

from fleet.sim.broker.server import Broker

T = TypeVar("T")


class BrokerThread:
    """Runs a broker for as long as a ``with`` block lasts; takes what ``Broker`` takes."""

    def __init__(self, **arguments: Any) -> None:
        self.broker = Broker(**arguments)
        self._started: Future[None] = Future()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._thread = threading.Thread(target=self._run, name="fleet-broker", daemon=True)

    @property
    def port(self) -> int:
        """Return where the broker listens."""
        return self.broker.port

    def __enter__(self) -> Self:
        self._thread.start()
        self._started.result()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._stop
        self.call(self._stop.set)
        self._thread.join()

    def call(self, function: Callable[..., T], *arguments: object) -> T:
        """Run a function on the broker's thread and return its result: ``call(broker.half_open, "a")``."""
        assert self._loop

        async def run() -> T:
            return function(*arguments)

        return asyncio.run_coroutine_threadsafe(run(), self._loop).result()

    def _run(self) -> None:
        """Be the broker's thread."""
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        """Listen until told to stop."""
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        try:
            async with self.broker:
                self._started.set_result(None)
                await self._stop.wait()
        except Exception as error:
            if self._started.done():
                raise
            self._started.set_exception(error)
