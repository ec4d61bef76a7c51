"""Round-trip time to the cloud, from occasional pings and the cloud's pongs."""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.wire.ping import is_clouds_pong

PING_EVERY = 10.0  # s between pings
LATE_AFTER = 30.0  # s after which the round trip is unknown until the pong is here
LOST_AFTER = 120.0  # s; no pong is so late, so the ping or its pong was lost


class RoundTrip:
    """Measures the round trip on one twin.

    A pong does not say which ping it answers. Therefore no ping is sent while another one may still be
    answered, and each pong belongs to the only ping in flight, however late it is.

    ``seconds`` is the last round trip; None before the first, and when pongs are missing.
    """

    def __init__(self, send: Callable[[], object], clock: Clock) -> None:
        self._send = send
        self._clock = clock
        self._next = clock.monotonic()
        self._sent: float | None = None
        self.seconds: float | None = None

    def request(self) -> None:
        """Send a ping if one is due and none is in flight."""
        now = self._clock.monotonic()
        if now < self._next:
            return
        self._next = now + PING_EVERY
        if self._sent is not None:
            late = now - self._sent
            if late >= LATE_AFTER:
                self.seconds = None
            if late < LOST_AFTER:
                return
        self._sent = now
        self._send()

    def handle_pong(self, payload: bytes) -> None:
        """Handle a pong; raises WireError if malformed. Pongs of other edges say nothing about the cloud."""
        if is_clouds_pong(payload) and self._sent is not None:
            self.seconds = self._clock.monotonic() - self._sent
            self._sent = None
