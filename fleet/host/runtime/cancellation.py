"""Bounded waiting for an adapter's coroutine, even if it ignores its cancellation."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, aclosing, nullcontext
from typing import Any, TypeVar

from fleet.runtime.exception_barrier import failure_of

ResultT = TypeVar("ResultT")

AGAIN_AFTER = 0.5  # s after which a task that goes on is cancelled again
IGNORED_AFTER = 2.0  # s after which a cancelled task that goes on counts as a failure of the adapter


async def wait_bounded(work: Coroutine[object, object, ResultT], seconds: float) -> ResultT:
    """Return the result of ``work``. If it ignores its cancellation it is abandoned, not waited for.

    Raises TimeoutError after ``seconds``, RuntimeError when ``work`` was cancelled from within.
    """
    task = asyncio.ensure_future(work)
    task.add_done_callback(retrieve_exception)
    try:
        done, _ = await asyncio.wait({task}, timeout=seconds)
    finally:
        task.cancel()
    if not done:
        raise TimeoutError
    return result_of(task)


def result_of(task: asyncio.Future[ResultT]) -> ResultT:
    """Return or raise the result of a finished task; RuntimeError if it was cancelled, since not by us.

    A GeneratorExit that the task raised becomes a RuntimeError, too: handlers of Exception halt the robot.
    """
    if task.cancelled():
        raise RuntimeError("the adapter was cancelled from within")
    if isinstance(error := task.exception(), GeneratorExit):
        raise failure_of(error)
    return task.result()


def retrieve_exception(task: asyncio.Future[Any]) -> None:
    """Retrieve a finished task's exception, so that asyncio does not log it as never retrieved."""
    if not task.cancelled():
        task.exception()


def cancel_and_wait(task: asyncio.Task[None], why: str, on_ignored: Callable[[Exception], None]) -> None:
    """Cancel a task; ``on_ignored`` gets an error if it is still running after ``IGNORED_AFTER`` seconds."""

    def report_ignored() -> None:
        on_ignored(RuntimeError(f"{task.get_name()} goes on though it was ended ({why})"))

    task.cancel(why)
    timer = asyncio.get_running_loop().call_later(IGNORED_AFTER, report_ignored)
    task.add_done_callback(lambda _: timer.cancel())


async def end_task(task: asyncio.Future[Any]) -> None:
    """Cancel a task and wait for its end; cancel it again while it goes on.

    A library may swallow a cancellation that comes at the moment at which its wait ends, as each
    ``asyncio.wait_for`` does with Python 3.11. Our own code uses ``asyncio.timeout``.
    """
    task.cancel()
    while (await asyncio.wait({task}, timeout=AGAIN_AFTER))[1]:
        task.cancel()


def closing(steps: AsyncIterator[object]) -> AbstractAsyncContextManager[AsyncIterator[Any]]:
    """Close an iteration when it is left early, so that its cleanup runs now, not at garbage collection."""
    return aclosing(steps) if isinstance(steps, AsyncGenerator) else nullcontext(steps)


def was_cancelled() -> bool:
    """Return True if the current task was cancelled; False for a CancelledError raised inside it."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


async def no_wait() -> None:
    """Wait for nothing."""
