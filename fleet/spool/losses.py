"""What was lost on the way out: counted by topic and reason, until it has been told."""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Iterable

import msgspec

from fleet.wire.rules import TrafficClass


class Reason(enum.StrEnum):
    """Why a message will never arrive."""

    AGE = "age"  # it was not worth sending any more
    ROOM = "room"  # pushed out by the bound on memory or disk
    REFUSED = "refused"  # the broker would not take it
    CORRUPT = "corrupt"  # the file could not be read
    RATE = "rate"  # more of one kind than are told in a minute
    LOOP = "loop"  # what the cloud asked led to it again and again


class Gap(msgspec.Struct):
    """How many messages of a topic were lost for one reason, and when (Unix s) the first and the last."""

    topic: str
    reason: Reason
    lost: int
    since: float
    until: float


class Losses:
    """The losses that nobody has been told of yet; ``counts`` are all since the start."""

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
        """Take over what an earlier process lost."""
        for gap in gaps:
            self._gaps.setdefault((gap.topic, gap.reason), gap)

    def known(self) -> list[Gap]:
        """Return what nobody has been told of."""
        return list(self._gaps.values())

    def take(self) -> list[Gap]:
        """Remove and return it: from now on it is told."""
        gaps, self._gaps = list(self._gaps.values()), {}
        self.changed = self.changed or bool(gaps)
        return gaps
