"""The clock as an argument, so that nothing in the core reads the time by itself."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Source of time."""

    def monotonic(self) -> float:
        """Return seconds that never jump; for ages, leases and time-outs."""

    def time(self) -> float:
        """Return Unix seconds; only for time stamps that leave the process."""


class SystemClock:
    """The computer's clock.

    Its methods are the C functions themselves, because they are called for every message.
    """

    monotonic = staticmethod(time.monotonic)
    time = staticmethod(time.time)
