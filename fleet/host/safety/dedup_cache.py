"""Answering a repeated ask with its first answer instead of doing it twice.

QoS 1 redelivers without a reliable DUP flag, so repeats are known by content: the request id, the
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
    """The ids seen lately, and what answers each."""

    def __init__(self) -> None:
        self._seen: OrderedDict[str, tuple[float, AnswerT]] = OrderedDict()
        self._look = -math.inf  # when the oldest may have to be forgotten

    def first(self, identity: str, answer: AnswerT, now: float) -> AnswerT | None:
        """Return what answered the first of this id; None when this is the first, which is remembered.

        An empty id is never a repeat. ``now``: monotonic seconds.
        """
        if not identity:
            return None
        if now > self._look:
            self._forget(now)
        if identity in self._seen:
            return self._seen[identity][1]
        self._seen[identity] = (now, answer)
        if len(self._seen) > KEPT:
            self._seen.popitem(last=False)
        return None

    def _forget(self, now: float) -> None:
        """Forget those whose time is over."""
        while self._seen and now - self._oldest() > LIFETIME:
            self._seen.popitem(last=False)
        self._look = (self._oldest() if self._seen else now) + LIFETIME

    def _oldest(self) -> float:
        """Return when the oldest was seen."""
        return next(iter(self._seen.values()))[0]
