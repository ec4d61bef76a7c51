"""Deduplication: a repeated request gets the first answer and is not executed again.

QoS 1 redelivers without a reliable DUP flag, so repeats are recognized by content: the request id, the
action id, or the digest of a stamped message.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Generic, TypeVar

KEPT = 1024
LIFETIME = 300.0  # s

AnswerT = TypeVar("AnswerT")


class DedupCache(Generic[AnswerT]):
    """Recent request ids and their answers; at most ``KEPT``, for ``LIFETIME``."""

    def __init__(self) -> None:
        self._seen: OrderedDict[str, tuple[float, AnswerT]] = OrderedDict()
        self._next_expiry = -math.inf  # when the oldest entry may expire (monotonic s)

    def first(self, identity: str, answer: AnswerT, now: float) -> AnswerT | None:
        """Return the answer to the first request with this id; None when this is the first, now stored.

        An empty id is never a repeat. ``now``: monotonic seconds.
        """
        if not identity:
            return None
        if now > self._next_expiry:
            self._forget(now)
        if identity in self._seen:
            return self._seen[identity][1]
        self._seen[identity] = (now, answer)
        if len(self._seen) > KEPT:
            self._seen.popitem(last=False)
        return None

    def _forget(self, now: float) -> None:
        """Remove expired entries."""
        while self._seen and now - self._oldest() > LIFETIME:
            self._seen.popitem(last=False)
        self._next_expiry = (self._oldest() if self._seen else now) + LIFETIME

    def _oldest(self) -> float:
        """Return the time of the oldest entry."""
        return next(iter(self._seen.values()))[0]
