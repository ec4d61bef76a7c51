"""Waiting in tests: on what should happen, with a deadline, never for a fixed time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

DEADLINE = 60.0  # s; busy computers are slow, and when all is well nothing waits for it
LOOK = 0.02  # s between looks


def wait_until(what: str, holds: Callable[[], T], *, within: float = DEADLINE) -> T:
    """Return the first true value of ``holds``; raises AssertionError after ``within`` seconds.

    For threads and processes; ``what`` names what was awaited.
    """
    end = time.monotonic() + within
    pause = threading.Event()
    while True:
        value = holds()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"waited {within:g} s for {what}")
        pause.wait(LOOK)
