"""How long to wait before a fallen link, robot or session is tried again."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator

FIRST = 0.5  # s
LONGEST = 30.0  # s


def backoff(
    first: float = FIRST,
    longest: float = LONGEST,
    *,
    factor: float = 2.0,
    jitter: float = 0.25,
    fraction: Callable[[], float] = random.random,
) -> Iterator[float]:
    """Yield seconds to wait, growing by ``factor`` from ``first`` to ``longest``, for ever.

    Each is shortened by up to ``jitter`` of itself, so that robots that fell together do not come back
    together. ``fraction`` gives numbers in [0, 1). A success starts a new generator.
    """
    delay = first
    while True:
        yield delay * (1.0 - jitter * fraction())
        delay = min(longest, delay * factor)
