"""Stops that a broker keeps: each counts once, and not again whenever the connection is made anew.

One that was obeyed when it was sent is known too: the broker may have kept it since. What is known is lost
with the process: the next one obeys a kept stop once more.
"""

from __future__ import annotations

from collections import OrderedDict

from fleet.wire.envelope import digest

MOST = 1024  # stops remembered; one that is forgotten counts again


class RetainedStops:
    """The stops that have counted."""

    def __init__(self) -> None:
        self._counted: OrderedDict[str, None] = OrderedDict()

    def note(self, topic: str, payload: bytes) -> None:
        """Remember a stop that is obeyed."""
        mark = _mark(topic, payload)
        self._counted[mark] = None
        self._counted.move_to_end(mark)
        if len(self._counted) > MOST:
            self._counted.popitem(last=False)

    def counted(self, topic: str, payload: bytes) -> bool:
        """Return True for a stop that was obeyed; it is remembered for as long as the broker sends it."""
        mark = _mark(topic, payload)
        if mark not in self._counted:
            return False
        self._counted.move_to_end(mark)
        return True


def _mark(topic: str, payload: bytes) -> str:
    """Return what tells a stop from every other message."""
    return digest(topic.encode(errors="replace") + b"\0" + payload)
