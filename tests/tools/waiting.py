"""Waits in tests: for a condition with a deadline, never for a fixed time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

DEADLINE = 60.0  # s; long because busy computers are slow, and a passing test never waits for it
SHORTEST_PAUSE, LONGEST_PAUSE = 0.02, 0.25  # s between checks
PAUSE_SHARE = 0.05
"""Pause as a share of the time waited so far: costly checks must not slow down what they wait for."""


def wait_until(what: str, holds: Callable[[], T], *, within: float = DEADLINE) -> T:
    """Return the first true value of ``holds``; raises AssertionError after ``within`` seconds.

    For threads and processes; ``what`` describes the awaited condition in the error.
    """
    began = time.monotonic()
    never = threading.Event()
    while True:
        value = holds()
        if value:
            return value
        waited = time.monotonic() - began
        if waited > within:
            raise AssertionError(f"waited {within:g} s for {what}")
        never.wait(min(max(PAUSE_SHARE * waited, SHORTEST_PAUSE), LONGEST_PAUSE))
