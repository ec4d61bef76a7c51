"""Bringing a robot to a standstill, whatever its adapter does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.errors import TimedOut
from fleet.host.requests.event_reporter import robot_log
from fleet.host.runtime.cancellation import wait_bounded
from fleet.runtime.exception_barrier import call_guarded, guarded


def write_halt(adapter: Adapter[Any] | None, name: str, *, emergency: bool) -> None:
    """Have an adapter write its halt at once; from any thread; never raises."""
    try:
        if adapter is not None:
            call_guarded(adapter.emergency_halt if emergency else adapter.halt)
    except Exception:  # noqa: BLE001 - told
        robot_log(name).exception("its halt failed")


def what_was_written(adapter: Adapter[Any] | None, *, heard: bool) -> str:
    """Say what became of the halt of a robot that does not answer; ``heard``: since its adapter began."""
    if adapter is None:
        return "the stop was not written: no link to it is open"
    if not heard:
        return "the stop may not have been written: it has not been heard since its adapter began"
    return "the stop was written, nobody answers"


async def stand_still(
    adapter: Adapter[Any], why: str, within: float, *, name: str, halt: Callable[[], None]
) -> None:
    """Have an adapter stop its robot ``within`` seconds; one that does not, or raises, is halted.

    Raises CommandError, LinkError, or a crash of the adapter's.
    """
    try:
        await wait_bounded(guarded(lambda: adapter.stop(why)), within)
    except TimeoutError:
        halt()
        robot_log(name).error("the adapter did not stop within %g s", within)
        raise TimedOut(f"{name} did not stop within {within:g} s; it was halted") from None
    except Exception:
        halt()
        raise
