"""Brings a robot to a standstill, whatever its adapter does."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.errors import CommandError, LinkError, TimedOut
from fleet.host.requests.event_reporter import robot_log
from fleet.host.requests.receipt import Receipt
from fleet.host.runtime.blocking_calls import STOPPING
from fleet.host.runtime.cancellation import wait_bounded
from fleet.runtime.exception_barrier import failure_text, guarded

STOP_TIMEOUT = 5.0  # s; limit for an adapter to bring its robot to a standstill


async def stand_still(adapter: Adapter[Any], why: str, *, name: str, halt: Callable[[], None]) -> None:
    """Make an adapter stop its robot within ``STOP_TIMEOUT``; if it does not, or raises, halt the robot.

    Raises CommandError, LinkError, or the error of an adapter that crashed.
    """
    try:
        await wait_bounded(guarded(lambda: _stop(adapter, why)), STOP_TIMEOUT)
    except TimeoutError:
        halt()
        robot_log(name).error("the adapter did not stop within %g s", STOP_TIMEOUT)
        raise TimedOut(f"{name} did not stop within {STOP_TIMEOUT:g} s; it was halted") from None
    except Exception:
        halt()
        raise


async def answer_stop(
    standing: Awaitable[None],
    receipt: Receipt,
    *,
    absence: Callable[[], str],
    crashed: Callable[[Exception], None],
) -> None:
    """Wait until a robot stands, then answer; ``absence`` returns why it is unreachable by then."""
    try:
        await standing
    except (CommandError, LinkError) as error:
        receipt.fail(error)
    except Exception as error:  # noqa: BLE001 - exception barrier: passed to the runner, which ends the run
        receipt.reject(f"the adapter failed: {failure_text(error)}")
        crashed(error)
    else:  # an adapter does not report a link that failed meanwhile
        why = absence()
        receipt.reject(why) if why else receipt.done()


async def _stop(adapter: Adapter[Any], why: str) -> None:
    """Stop the robot; the adapter's blocking calls are exempt from their limit."""
    STOPPING.set(True)
    await adapter.stop(why)
