"""Tokens in the addresses of the live view; without I/O.

Foxglove reconnects by the same address, so a token can be used repeatedly, as long as it is in use.
"""

from __future__ import annotations

import hashlib
import secrets

from fleet.clock import Clock

LIFE = 12 * 3600.0  # s without use after which a token expires
MOST = 32  # tokens; a new one replaces the oldest
_BYTES = 32  # of randomness


class Tokens:
    """The tokens of one console; only digests are stored."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._until: dict[bytes, float] = {}

    def new(self) -> str:
        """Return a new token."""
        now = self._clock.monotonic()
        self._until = {key: until for key, until in self._until.items() if until > now}
        while len(self._until) >= MOST:
            self._until.pop(next(iter(self._until)))
        token = secrets.token_urlsafe(_BYTES)
        self._until[_digest(token)] = now + LIFE
        return token

    def renew(self, token: str) -> bool:
        """Return True if a token is valid; its use renews it."""
        key, now = _digest(token), self._clock.monotonic()
        if self._until.get(key, now) <= now:
            return False
        self._until[key] = now + LIFE
        return True


def _digest(token: str) -> bytes:
    """Return the stored digest of a token."""
    return hashlib.sha256(token.encode(errors="replace")).digest()
