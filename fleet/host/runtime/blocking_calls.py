"""Calls of a blocking SDK, each on its own thread, so that none queues behind another.

A thread pool would queue: a stop would wait behind calls that hang. Instead the number of ordinary calls is
limited, and calls on behalf of a stop are never refused.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, TypeVar

from fleet.errors import NotReady
from fleet.runtime.exception_barrier import failure_of

MOST = 8  # calls of one robot in progress, except those of stops; each holds a thread
STOPPING: ContextVar[bool] = ContextVar("fleet_stopping", default=False)
"""True in the task that stops a robot: its calls are not counted."""

ResultT = TypeVar("ResultT")


class BlockingCalls:
    """Blocking calls of one robot. They outlive its attempts, because a thread cannot be ended."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._inflight = 0

    async def call(self, call: Callable[..., ResultT], /, *args: Any, **kwargs: Any) -> ResultT:
        """Return the result of a call; raises its error, or NotReady while too many calls hang."""
        counts = not STOPPING.get()
        if counts and self._inflight >= MOST:
            raise NotReady(f"{MOST} calls to its SDK hang", hint="restart the robot, then its adapter")
        loop = asyncio.get_running_loop()
        outcome: asyncio.Future[ResultT] = loop.create_future()

        def ended(result: ResultT | None, error: BaseException | None) -> None:
            self._inflight -= counts
            if outcome.cancelled():
                return
            if error is not None:
                outcome.set_exception(failure_of(error))
            else:
                outcome.set_result(result)  # type: ignore[arg-type]

        def work() -> None:
            result, failure = None, None
            try:
                result = call(*args, **kwargs)
            except BaseException as error:  # noqa: BLE001 - raised again on the loop
                failure = error
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(ended, result, failure)

        self._inflight += counts
        try:
            threading.Thread(target=work, name=f"fleet-sdk-{self._name}", daemon=True).start()
        except RuntimeError as error:
            self._inflight -= counts
            raise NotReady(f"no thread for a call to its SDK: {error}") from error
        return await outcome
