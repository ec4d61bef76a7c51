"""Queue of one viewer: in order, but conflated to the newest sample per channel if it is slow; pure."""

from __future__ import annotations

from fleet.console.foxglove.channels import Sample

LATE = 1.0  # s that a sample may wait
MOST_BYTES = 8 * 1024 * 1024


class Backlog:
    """The samples that wait for a viewer. ``lost`` counts those replaced by newer ones."""

    def __init__(self) -> None:
        self.lost = 0
        self._waiting: list[Sample] = []
        self._bytes = 0
        self._since = 0.0

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def add(self, sample: Sample, now: float) -> None:
        """Add a sample; ``now`` in seconds of any monotonic clock."""
        if not self._waiting:
            self._since = now
        elif now - self._since > LATE or self._bytes + len(sample.payload) > MOST_BYTES:
            self._conflate(now)
        self._waiting.append(sample)
        self._bytes += len(sample.payload)

    def take(self) -> list[Sample]:
        """Remove and return the waiting samples."""
        taken, self._waiting, self._bytes = self._waiting, [], 0
        return taken

    def _conflate(self, now: float) -> None:
        """Keep only the newest sample of each channel."""
        newest = {sample.channel: sample for sample in self._waiting}
        kept = sorted(newest.values(), key=lambda sample: sample.received)
        self.lost += len(self._waiting) - len(kept)
        self._waiting, self._since = kept, now
        self._bytes = sum(len(sample.payload) for sample in kept)
