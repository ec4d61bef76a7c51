"""Answering a repeated ask with its first answer instead of doing it twice.

QoS 1 redelivers without a reliable DUP flag, so repeats are known by content: the request id, the
action id, or the digest of a stamped message.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Generic, TypeVar

KEPT = 1024
LIFETIME = 300.0  # s

AnswerT = TypeVar("AnswerT")


class Repeats(Generic[AnswerT]):
    """The ids seen lately, and what answers each."""

    def __init__(self) -> None:
        self._seen: OrderedDict[str, tuple[float, AnswerT]] = OrderedDict()

    def first(self, identity: str, answer: AnswerT, now: float) -> AnswerT | None:
        """Return what answered the first of this id; None when this is the first, which is remembered.

        An empty id is never a repeat. ``now``: monotonic seconds.
        """
        if not identity:
            return None
        while self._seen and now - next(iter(self._seen.values()))[0] > LIFETIME:
            self._seen.popitem(last=False)
        if identity in self._seen:
            return self._seen[identity][1]
        self._seen[identity] = (now, answer)
        if len(self._seen) > KEPT:
            self._seen.popitem(last=False)
        return None
