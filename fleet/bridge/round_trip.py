"""Round-trip time to the cloud, from occasional pings and the cloud's pongs."""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.wire.ping import is_clouds_pong

PING_EVERY = 10.0  # s between pings
LOST_AFTER = 30.0  # s; later pongs belong to no known ping


class RoundTrip:
    """Measures the round trip on one twin.

    ``seconds`` is the last round trip; None before the first, and when pongs are missing.
    """

    def __init__(self, send: Callable[[], object], clock: Clock) -> None:
        self._send = send
        self._clock = clock
        self._next = clock.monotonic()
        self._sent: float | None = None
        self.seconds: float | None = None

    def ask(self) -> None:
        """Send a ping if one is due and none is in flight."""
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
        """Handle a pong; raises WireError if malformed. Pongs of other edges say nothing about the cloud."""
        if is_clouds_pong(payload) and self._sent is not None:
            self.seconds = self._clock.monotonic() - self._sent
            self._sent = None
