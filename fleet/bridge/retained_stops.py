"""Retained stops: each is executed once, not again after every reconnect.

Stops that arrived without the retain flag are remembered too: the broker may have retained them since. The
memory is lost with the process, so its successor executes a retained stop once more.
"""

from __future__ import annotations

from collections import OrderedDict

from fleet.wire.envelope import digest

MOST = 1024  # stops remembered; a forgotten one is executed again


class RetainedStops:
    """The stops that were executed."""

    def __init__(self) -> None:
        self._counted: OrderedDict[str, None] = OrderedDict()

    def note(self, topic: str, payload: bytes) -> None:
        """Remember a stop that is executed."""
        key = _key(topic, payload)
        self._counted[key] = None
        self._counted.move_to_end(key)
        if len(self._counted) > MOST:
            self._counted.popitem(last=False)

    def counted(self, topic: str, payload: bytes) -> bool:
        """Return True for a stop that was executed, and keep remembering it while the broker sends it."""
        key = _key(topic, payload)
        if key not in self._counted:
            return False
        self._counted.move_to_end(key)
        return True


def _key(topic: str, payload: bytes) -> str:
    """Return a digest that identifies a stop."""
    return digest(topic.encode(errors="replace") + b"\0" + payload)
