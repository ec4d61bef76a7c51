"""Exponential back-off with jitter, between attempts to reconnect a link, robot or session."""

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
    """Yield delays in seconds, growing by ``factor`` from ``first`` to ``longest``, for ever.

    Each delay is shortened by up to its ``jitter`` fraction, so that robots that were lost together do not
    reconnect together. ``fraction`` returns random numbers in [0, 1). After a success, start a new generator.
    """
    delay = first
    while True:
        yield delay * (1.0 - jitter * fraction())
        delay = min(longest, delay * factor)
