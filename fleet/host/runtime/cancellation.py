"""Waiting for an adapter's coroutine no longer than is given, whatever it does with its cancellation."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, aclosing, nullcontext
from typing import Any, TypeVar

ResultT = TypeVar("ResultT")

DEAF_AFTER = 2.0  # s after which a task that was cancelled and goes on is a failure of the adapter


async def wait_bounded(work: Coroutine[object, object, ResultT], seconds: float) -> ResultT:
    """Return what ``work`` returns. What ignores its cancellation is left behind, not waited for.

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
    """Return or raise what a finished task did; its cancellation is not ours: a RuntimeError."""
    if task.cancelled():
        raise RuntimeError("the adapter was cancelled from within")
    return task.result()


def retrieve_exception(task: asyncio.Future[Any]) -> None:
    """Look at a finished task's exception, which nobody else will ask for."""
    if not task.cancelled():
        task.exception()


def cancel_and_wait(task: asyncio.Task[None], why: str, deaf: Callable[[Exception], None]) -> None:
    """Cancel a task; ``deaf`` hears of one that goes on for ``DEAF_AFTER`` seconds all the same."""

    def look() -> None:
        deaf(RuntimeError(f"{task.get_name()} goes on though it was ended ({why})"))

    task.cancel(why)
    timer = asyncio.get_running_loop().call_later(DEAF_AFTER, look)
    task.add_done_callback(lambda _: timer.cancel())


def closing(steps: AsyncIterator[object]) -> AbstractAsyncContextManager[AsyncIterator[Any]]:
    """Close an iteration when it is left early: its clean-up happens now, not some time later."""
    return aclosing(steps) if isinstance(steps, AsyncGenerator) else nullcontext(steps)


def was_cancelled() -> bool:
    """Return True when somebody cancelled the task that runs; False for a stray CancelledError in it."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


async def no_wait() -> None:
    """Wait for nothing."""
