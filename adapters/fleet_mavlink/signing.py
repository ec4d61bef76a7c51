"""MAVLink 2 signing: frames that only a holder of the key can create, and that cannot be replayed.

A signature consists of a link id, a strictly increasing time (10 us since 2015), and the first six bytes of
SHA-256 over key and frame.
"""

from __future__ import annotations

import hashlib
import hmac
import threading
from collections.abc import Callable

_EPOCH = 1_420_070_400  # Unix seconds of 2015-01-01
_TICKS = 100_000  # per second
_LATE = 60 * _TICKS  # largest age of the first frame of a new stream, relative to the newest signature
KEY_BYTES = 32
SIGNATURE_BYTES = 13


def key_of(text: str) -> bytes:
    """Return the key for a passphrase, derived as ground stations do it; 64 hex digits are the key itself."""
    if len(text) == 2 * KEY_BYTES:
        try:
            return bytes.fromhex(text)
        except ValueError:
            pass  # a passphrase of that length
    return hashlib.sha256(text.encode()).digest()


class Signer:
    """Signs frames to one vehicle and checks frames from it; ``now`` returns Unix seconds."""

    def __init__(self, key: bytes, now: Callable[[], float]) -> None:
        self.key = key
        self._now = now
        self._lock = threading.Lock()
        self._newest = 0
        self._heard: dict[tuple[int, int, int], int] = {}

    def stamp(self) -> int:
        """Return the time of the next signature, later than all before; from any thread."""
        with self._lock:
            self._newest = max(self._newest + 1, int((self._now() - _EPOCH) * _TICKS))
            return self._newest

    def signature(self, frame: bytes, link: int) -> bytes:
        """Return the signature of a frame that ends with its checksum."""
        signed = frame + bytes([link]) + self.stamp().to_bytes(6, "little")
        return signed[len(frame) :] + self._digest(signed)

    def _digest(self, signed: bytes) -> bytes:
        """Return the digest that ends a frame."""
        return hashlib.sha256(self.key + signed).digest()[:6]

    def accepts(self, frame: bytes) -> bool:
        """Return True if a signed frame was created with the key and is not a replay."""
        stamp = int.from_bytes(frame[-12:-6], "little")
        stream = (frame[5], frame[6], frame[-SIGNATURE_BYTES])
        last = self._heard.get(stream)
        is_old = stamp <= last if last is not None else stamp + _LATE < self._newest
        if is_old or not hmac.compare_digest(frame[-6:], self._digest(frame[:-6])):
            return False
        self._heard[stream] = stamp
        with self._lock:
            self._newest = max(self._newest, stamp)
        return True
