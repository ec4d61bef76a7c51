"""Flood filter: keeps a log readable and its disk free when a line repeats a thousand times a second."""

from __future__ import annotations

from collections.abc import Hashable

import msgspec

WINDOW = 60.0  # s
MOST = 100  # lines of one kind in that time; a kind is a logger and a line's format string
MOST_KINDS = (
    1_000  # lines formatted before they are logged are a kind each: beyond this number they share one
)


class _LineKind(msgspec.Struct):
    """Lines of one kind since a time (s): written, and left out."""

    since: float
    written: int = 0
    left_out: int = 0


class FloodFilter:
    """Decides which lines are written. Lines left out are counted; the next of their kind has the number."""

    def __init__(self) -> None:
        self._kinds: dict[Hashable, _LineKind] = {}

    def admit(self, kind: Hashable, now: float) -> int | None:
        """Return how many such lines were left out before this one; None if this one is left out."""
        if kind not in self._kinds and len(self._kinds) >= MOST_KINDS:
            kind = None
        found = self._kinds.setdefault(kind, _LineKind(now))
        if not 0 <= now - found.since < WINDOW:  # a clock that was set back starts a new window
            found.since, found.written = now, 0
        if found.written >= MOST:
            found.left_out += 1
            return None
        found.written += 1
        left_out, found.left_out = found.left_out, 0
        return left_out
