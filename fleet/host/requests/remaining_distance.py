"""Remaining distance of a task, and the time left at the pace of the last seconds. Pure."""

from __future__ import annotations

import math
from collections import deque

WINDOW = 5.0  # s over which the pace is measured
SHORTEST = 1.0  # s of data that a pace needs
SLOWEST = 0.05  # m/s; below it the robot makes no progress


class RemainingDistance:
    """Remaining metres of one task, as its follower reports them, and the seconds that result from them.

    Both are None while unknown; ``seconds`` also while the robot rests or does not get nearer.
    """

    def __init__(self) -> None:
        self.metres: float | None = None
        self.seconds: float | None = None
        self._seen: deque[tuple[float, float]] = deque()  # (monotonic s, metres left)

    def update(self, metres: float | None, now: float) -> None:
        """Record the distance left at ``now`` (monotonic s)."""
        self.metres, self.seconds = None, None
        if metres is None or not math.isfinite(metres):
            self._seen.clear()
            return
        self.metres = metres
        self._seen.append((now, metres))
        while now - self._seen[0][0] > WINDOW:
            self._seen.popleft()
        since, before = self._seen[0]
        if now - since >= SHORTEST and (pace := (before - metres) / (now - since)) >= SLOWEST:
            self.seconds = metres / pace

    def rest(self) -> None:
        """Drop the pace: the robot rests."""
        self.seconds = None
        self._seen.clear()
