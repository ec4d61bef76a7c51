"""Bringing a robot to a standstill in time, whatever its adapter does."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.errors import TimedOut
from fleet.host.bounded import bounded

log = logging.getLogger(__name__)


async def stand_still(
    adapter: Adapter[Any], why: str, within: float, *, name: str, halt: Callable[[], None]
) -> None:
    """Have an adapter stop its robot ``within`` seconds; one that does not, or raises, is halted.

    Raises CommandError, LinkError, or a crash of the adapter's.
    """
    try:
        await bounded(adapter.stop(why), within)
    except TimeoutError:
        halt()
        log.error("%s: the adapter did not stop within %g s", name, within)  # noqa: TRY400
        raise TimedOut(f"{name} did not stop within {within:g} s; it was halted") from None
    except Exception:
        halt()
        raise
