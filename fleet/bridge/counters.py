"""Message counters by traffic class, and latencies of commands."""

from __future__ import annotations

import bisect
from itertools import accumulate

from fleet.wire.rules import TrafficClass

LATENCY_BUCKETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # s


class ClassCounts:
    """One counter for each traffic class; written by one thread, read by any.

    The hot path increments ``counts`` (by class) directly: a call there costs as much as all the rest.
    """

    def __init__(self) -> None:
        self.counts = [0] * len(TrafficClass)

    def add(self, traffic: TrafficClass) -> None:
        """Count one message."""
        self.counts[traffic] += 1

    @property
    def total(self) -> int:
        """The sum of all classes."""
        return sum(self.counts)

    @property
    def durable(self) -> int:
        """The sum of the durable classes."""
        return sum(self.counts[traffic] for traffic in TrafficClass if traffic.durable)

    def by_class(self) -> dict[str, int]:
        """Return the counters by the name of the class."""
        return {traffic.word: self.counts[traffic] for traffic in TrafficClass}


class Latencies:
    """Histogram of durations in seconds, with the bounds of ``LATENCY_BUCKETS``."""

    def __init__(self) -> None:
        self._counts = [0] * (len(LATENCY_BUCKETS) + 1)
        self.total = 0.0

    def add(self, seconds: float) -> None:
        """Add one duration."""
        self._counts[bisect.bisect_left(LATENCY_BUCKETS, seconds)] += 1
        self.total += seconds

    @property
    def count(self) -> int:
        """The number of durations."""
        return sum(self._counts)

    def buckets(self) -> list[tuple[str, float]]:
        """Return pairs of upper bound and cumulative count, as Prometheus expects them."""
        bounds = [*(f"{bound:g}" for bound in LATENCY_BUCKETS), "+Inf"]
        return [(bound, float(count)) for bound, count in zip(bounds, accumulate(self._counts), strict=True)]
