"""How long the way to the cloud and back takes: one ping now and then, and the cloud's pong."""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.wire.ping import is_clouds_pong

PING_EVERY = 10.0  # s between pings
LOST_AFTER = 30.0  # s; a pong that comes later is of no ping that we remember


class RoundTrip:
    """Measures with one twin.

    ``seconds`` is the last round trip; None before the first, and when pongs stay out.
    """

    def __init__(self, send: Callable[[], object], clock: Clock) -> None:
        self._send = send
        self._clock = clock
        self._next = clock.monotonic()
        self._sent: float | None = None
        self.seconds: float | None = None

    def ask(self) -> None:
        """Send a ping, where it is time for one and none is under way."""
        now = self._clock.monotonic()
        if now < self._next:
            return
        self._next = now + PING_EVERY
        if self._sent is not None and now - self._sent < LOST_AFTER:
            return
        if self._sent is not None:
            self.seconds = None
        self._sent = now
        self._send()

    def heard(self, payload: bytes) -> None:
        """Take a pong; raises WireError for what is none. Another edge's says nothing about the cloud."""
        if is_clouds_pong(payload) and self._sent is not None:
            self.seconds = self._clock.monotonic() - self._sent
            self._sent = None
