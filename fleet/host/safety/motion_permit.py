"""Motion permit of an edge: in a pair, only the holder of the lease may move robots, and not at once."""

from __future__ import annotations

from collections.abc import Callable


def _always() -> str | None:
    """Permit motion: an edge that is not in a pair."""
    return None


def _ignore_stop() -> None:
    """Ignore a stop."""


class MotionPermit:
    """Motion permit of one robot: ``refusal`` says why nothing may move it; each stop calls ``stopped``."""

    def __init__(self) -> None:
        self.refusal: Callable[[], str | None] = _always
        self.stopped: Callable[[], None] = _ignore_stop
