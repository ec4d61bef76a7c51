"""Exception barrier around third-party code: anything it raises becomes an Exception.

``sys.exit`` in an adapter would end the edge, and a BaseException (such as a panic of a Rust library) would
bypass every handler that is meant to stop the robot.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from functools import wraps
from typing import ParamSpec, TypeVar

ResultT = TypeVar("ResultT")
Given = ParamSpec("Given")


async def guarded(work: Callable[[], Awaitable[ResultT]]) -> ResultT:
    """Return the result of ``work()``; a BaseException that it raises becomes a RuntimeError.

    A cancellation passes: it may be our own.
    """
    try:
        return await work()
    except (Exception, asyncio.CancelledError, KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:
        raise failure_of(error) from error


def call_guarded(work: Callable[..., ResultT], *arguments: object) -> ResultT:
    """Return the result of ``work(*arguments)``; a BaseException that it raises becomes a RuntimeError."""
    try:
        return work(*arguments)
    except (Exception, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise failure_of(error) from error


def log_exceptions(
    log: logging.Logger, failure: str
) -> Callable[[Callable[Given, object]], Callable[Given, None]]:
    """Return a decorator for calls on which nothing may depend: an exception is logged, with ``failure``."""

    def contain(call: Callable[Given, object]) -> Callable[Given, None]:
        @wraps(call)
        def tried(*given: Given.args, **named: Given.kwargs) -> None:
            try:
                call(*given, **named)
            except Exception:
                log.exception("%s", failure)

        return tried

    return contain


def failure_of(error: BaseException) -> Exception:
    """Return a raised error as an Exception that can be set on a future.

    A stray cancellation, a ``sys.exit``, a StopIteration and the like become a RuntimeError.
    """
    if isinstance(error, Exception) and not isinstance(error, StopIteration):
        return error
    did = f"called sys.exit({error.code!r})" if isinstance(error, SystemExit) else f"raised {error!r}"
    failure = RuntimeError(f"the adapter {did}")
    failure.__cause__ = error
    return failure
