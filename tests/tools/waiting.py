"""Waits in tests: for a condition with a deadline, never for a fixed time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

DEADLINE = 60.0  # s; long because busy computers are slow, and a passing test never waits for it
POLL_INTERVAL = 0.02  # s between checks


def wait_until(what: str, holds: Callable[[], T], *, within: float = DEADLINE) -> T:
    """Return the first true value of ``holds``; raises AssertionError after ``within`` seconds.

    For threads and processes; ``what`` describes the awaited condition in the error.
    """
    end = time.monotonic() + within
    pause = threading.Event()
    while True:
        value = holds()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"waited {within:g} s for {what}")
        pause.wait(POLL_INTERVAL)
