"""How far it is still to go, and how long that takes at the pace of the last seconds; pure."""

from __future__ import annotations

import math
from collections import deque

WINDOW = 5.0  # s over which the pace is seen
SHORTEST = 1.0  # s before a pace is one
SLOWEST = 0.05  # m/s; slower is no pace


class RemainingDistance:
    """The metres that are left of one task, as its leader tells them, and the seconds that follow from them.

    Both are None while they are unknown; ``seconds`` also while the robot rests or does not get nearer.
    """

    def __init__(self) -> None:
        self.metres: float | None = None
        self.seconds: float | None = None
        self._seen: deque[tuple[float, float]] = deque()  # when (monotonic s), and how many metres then

    def take(self, metres: float | None, now: float) -> None:
        """Note how far it is at ``now`` (monotonic s)."""
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
        """Forget the pace: the robot rests."""
        self.seconds = None
        self._seen.clear()
