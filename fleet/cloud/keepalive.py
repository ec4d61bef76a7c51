"""Keepalive: when to ping, and when to give up a silent connection (MQTT 5, section 3.1.2.10)."""

from __future__ import annotations

import enum

SHARE = 0.8
"""Share of the keepalive after which a quiet direction is pinged, and after which a ping counts as lost.

A dead link is detected after twice this, 1.6 keepalives, at the latest.
"""


class KeepaliveAction(enum.Enum):
    """The action that is due."""

    NOTHING = enum.auto()
    PING = enum.auto()
    GIVE_UP = enum.auto()


class Keepalive:
    """Watches both directions of one connection, in monotonic seconds; an interval of 0 disables it."""

    def __init__(self, interval: float, now: float) -> None:
        self.interval = interval
        self._sent = now
        self._received = now
        self._pinged: float | None = None

    @property
    def limit(self) -> float:
        """The longest time, in seconds, until a dead link is detected."""
        return self.interval * SHARE * 2

    def sent(self, now: float) -> None:
        """Record that bytes were written."""
        self._sent = now

    def received(self, now: float) -> None:
        """Record that bytes arrived; any bytes prove that the link is alive."""
        self._received = now
        self._pinged = None

    def due(self, now: float) -> KeepaliveAction:
        """Return the action that is due; a returned PING counts as sent."""
        quiet = self.interval * SHARE
        if not quiet:
            return KeepaliveAction.NOTHING
        if self._pinged is not None:
            return KeepaliveAction.GIVE_UP if now - self._pinged >= quiet else KeepaliveAction.NOTHING
        if now - min(self._sent, self._received) < quiet:
            return KeepaliveAction.NOTHING
        self._pinged = self._sent = now
        return KeepaliveAction.PING
