"""The wall around anybody's code: whatever it raises comes out as an Exception, and ends nobody else.

``sys.exit`` in an adapter would end the edge, and what is no Exception (a panic of a library in Rust, say)
passes every handler that is meant to stop the robot.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

ResultT = TypeVar("ResultT")


async def guarded(work: Callable[[], Awaitable[ResultT]]) -> ResultT:
    """Return what ``work()`` returns; what it raises beside Exceptions is a RuntimeError.

    A cancellation passes: it may be ours.
    """
    try:
        return await work()
    except (Exception, asyncio.CancelledError, KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:
        raise failure_of(error) from error


def call_guarded(work: Callable[..., ResultT], *arguments: object) -> ResultT:
    """Return what ``work(*arguments)`` returns; what it raises beside Exceptions is a RuntimeError."""
    try:
        return work(*arguments)
    except (Exception, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise failure_of(error) from error


def failure_of(error: BaseException) -> Exception:
    """Return what was raised as a failure that a future takes, and that ends nobody else.

    A stray cancellation, a ``sys.exit``, a StopIteration and the like become a RuntimeError.
    """
    if isinstance(error, Exception) and not isinstance(error, StopIteration):
        return error
    did = f"called sys.exit({error.code!r})" if isinstance(error, SystemExit) else f"raised {error!r}"
    failure = RuntimeError(f"the adapter {did}")
    failure.__cause__ = error
    return failure
