"""Time as a value that is handed in, so that nothing in the core reads it by itself."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What the code asks of time."""

    def monotonic(self) -> float:
        """Return seconds that never jump; for ages, leases and time-outs."""

    def time(self) -> float:
        """Return Unix seconds; for stamps that leave the process, and nothing else."""


class SystemClock:
    """The computer's own time: the two functions themselves, which are called for every message."""

    monotonic = staticmethod(time.monotonic)
    time = staticmethod(time.time)
