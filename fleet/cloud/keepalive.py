"""When to ping and when to give a silent connection up (MQTT 5, section 3.1.2.10)."""

from __future__ import annotations

import enum

SHARE = 0.8
"""Part of the keepalive after which a quiet direction is pinged, and after which a ping counts as lost.

Twice this, 1.6 keepalives, is the longest that a dead link goes unnoticed.
"""


class KeepaliveAction(enum.Enum):
    """What the watch asks for."""

    NOTHING = enum.auto()
    PING = enum.auto()
    GIVE_UP = enum.auto()


class Keepalive:
    """Watches both directions of one connection, in monotonic seconds; an interval of 0 watches nothing."""

    def __init__(self, interval: float, now: float) -> None:
        self.interval = interval
        self._sent = now
        self._received = now
        self._pinged: float | None = None

    @property
    def limit(self) -> float:
        """Return the longest time, in seconds, that a dead link goes unnoticed."""
        return self.interval * SHARE * 2

    def sent(self, now: float) -> None:
        """Note that bytes were written."""
        self._sent = now

    def received(self, now: float) -> None:
        """Note that bytes arrived: whatever they are, the link is alive."""
        self._received = now
        self._pinged = None

    def due(self, now: float) -> KeepaliveAction:
        """Return what to do now; a PING is taken as sent."""
        quiet = self.interval * SHARE
        if not quiet:
            return KeepaliveAction.NOTHING
        if self._pinged is not None:
            return KeepaliveAction.GIVE_UP if now - self._pinged >= quiet else KeepaliveAction.NOTHING
        if now - min(self._sent, self._received) < quiet:
            return KeepaliveAction.NOTHING
        self._pinged = self._sent = now
        return KeepaliveAction.PING
