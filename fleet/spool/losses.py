"""Lost messages, counted by topic and reason until they are reported."""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Iterable

import msgspec

from fleet.wire.rules import TrafficClass


class Reason(enum.StrEnum):
    """Reason of a loss."""

    AGE = "age"  # expired
    ROOM = "room"  # displaced by the bound on memory or disk
    REFUSED = "refused"  # by the broker
    CORRUPT = "corrupt"  # the file could not be read
    RATE = "rate"  # above the events of a kind per minute
    LOOP = "loop"  # requests from the cloud caused it repeatedly


class Gap(msgspec.Struct):
    """Messages of a topic lost for one reason: how many, and the times (Unix s) of the first and the last."""

    topic: str
    reason: Reason
    lost: int
    since: float
    until: float


class MessageLosses:
    """The losses that have not been reported yet; ``counts`` has all since the start."""

    def __init__(self) -> None:
        self.counts: Counter[tuple[TrafficClass, Reason]] = Counter()
        self.changed = False
        self._gaps: dict[tuple[str, Reason], Gap] = {}

    @property
    def total(self) -> int:
        """All losses since the start."""
        return self.counts.total()

    def note(self, topic: str, traffic: TrafficClass, reason: Reason, wall: float, lost: int = 1) -> None:
        """Count a loss."""
        self.counts[traffic, reason] += lost
        self.changed = True
        gap = self._gaps.get((topic, reason))
        if gap is None:
            self._gaps[topic, reason] = Gap(topic, reason, lost, wall, wall)
        else:
            gap.lost += lost
            gap.until = wall

    def add(self, gaps: Iterable[Gap]) -> None:
        """Add the losses of an earlier process."""
        for gap in gaps:
            self._gaps.setdefault((gap.topic, gap.reason), gap)

    def known(self) -> list[Gap]:
        """Return the unreported losses."""
        return list(self._gaps.values())

    def take(self) -> list[Gap]:
        """Remove and return the unreported losses; the caller reports them."""
        gaps, self._gaps = list(self._gaps.values()), {}
        self.changed = self.changed or bool(gaps)
        return gaps
