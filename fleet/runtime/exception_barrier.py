"""Exception barrier around third-party code: anything it raises becomes an Exception.

``sys.exit`` in an adapter would end the edge, and a BaseException (such as a panic of a Rust library) would
bypass every handler that is meant to stop the robot.
"""

from __future__ import annotations

import asyncio
import logging
import sysconfig
import traceback
from collections.abc import Awaitable, Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")
_HOST = Path(__file__).parents[1]
_LIBRARIES = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib"))


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
) -> Callable[[Callable[ParamsT, object]], Callable[ParamsT, None]]:
    """Return a decorator for calls on which nothing may depend: an exception is logged, with ``failure``."""

    def contain(call: Callable[ParamsT, object]) -> Callable[ParamsT, None]:
        @wraps(call)
        def tried(*given: ParamsT.args, **named: ParamsT.kwargs) -> None:
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


def error_text(error: BaseException) -> str:
    """Return the text of an error; the name of its class if it has none, as asyncio's TimeoutError."""
    return str(error) or type(error).__name__


def failure_text(error: BaseException) -> str:
    """Return an error of an adapter in one line: class, text, and the place in the adapter that raised it."""
    places = [place for each in _chain(error) if (place := _place_of(each))]
    text = f": {error}" if str(error) else ""
    return f"{type(error).__name__}{text}" + (f" ({places[-1]})" if places else "")


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and its causes."""
    while error is not None:
        yield error
        error = error.__cause__


def _place_of(error: BaseException) -> str:
    """Return the innermost place in the folder of the first code outside fleet and the standard library."""
    stack = traceback.extract_tb(error.__traceback__)
    own = [entry for entry in stack if not _is_ours(Path(entry.filename))]
    if not own:
        return ""
    last = [entry for entry in own if Path(entry.filename).parent == Path(own[0].filename).parent][-1]
    return f"{Path(last.filename).name}:{last.lineno} in {last.name}"


def _is_ours(file: Path) -> bool:
    """Return True for code of fleet itself or of the standard library."""
    return file.is_relative_to(_HOST) or file.name.startswith("<frozen") or is_standard_library(file)


def is_standard_library(file: Path) -> bool:
    """Return True for a file of the standard library, which only executes calls of others."""
    return "site-packages" not in file.parts and any(map(file.is_relative_to, _LIBRARIES))
