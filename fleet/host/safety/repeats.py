"""Answering a repeated command with its first answer instead of doing it twice.

QoS 1 redelivers without a reliable DUP flag, so repeats are known by content: the request id, the
action id, or the digest of a stamped message.
"""

from __future__ import annotations

from collections import OrderedDict

from fleet.model.command import Reply

KEPT = 1024
LIFETIME = 300.0  # s


class Repeats:
    """The ids seen lately, and the answer each got."""

    def __init__(self) -> None:
        self._seen: OrderedDict[str, tuple[float, Reply | None]] = OrderedDict()

    def seen(self, identity: str, now: float) -> bool:
        """Return True for a repeat; a first one is remembered. An empty id is never a repeat."""
        if not identity:
            return False
        while self._seen and now - next(iter(self._seen.values()))[0] > LIFETIME:
            self._seen.popitem(last=False)
        if identity in self._seen:
            return True
        self._seen[identity] = (now, None)
        if len(self._seen) > KEPT:
            self._seen.popitem(last=False)
        return False

    def answered(self, identity: str, reply: Reply) -> None:
        """Remember the answer for repeats."""
        if identity in self._seen:
            self._seen[identity] = (self._seen[identity][0], reply)

    def answer(self, identity: str) -> Reply | None:
        """Return the first answer, None while there is none yet."""
        return self._seen.get(identity, (0.0, None))[1]
