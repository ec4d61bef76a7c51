"""Whether an edge may move a robot at all: of a pair, only the one that has the lease, and not at once."""

from __future__ import annotations

from collections.abc import Callable


def _always() -> str | None:
    """Permit motion, as an edge does that belongs to no pair."""
    return None


def _nothing() -> None:
    """Take no note."""


class MotionPermit:
    """The permit of one robot; ``refusal`` says why nothing may move it, ``stopped`` hears of each stop."""

    def __init__(self) -> None:
        self.refusal: Callable[[], str | None] = _always
        self.stopped: Callable[[], None] = _nothing
