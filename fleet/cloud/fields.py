"""The fields that packets of both protocol versions are made of, as bytes."""

from __future__ import annotations

import functools


@functools.lru_cache(maxsize=4096)  # most packets have one of few sizes
def length(size: int) -> bytes:
    """Return the length of what follows: seven bits a byte, the smaller end first."""
    pieces = bytearray()
    while True:
        size, low = size >> 7, size & 0x7F
        pieces.append(low | (0x80 if size else 0))
        if not size:
            return bytes(pieces)


def binary(value: bytes) -> bytes:
    """Return bytes behind their length."""
    if len(value) > 0xFFFF:
        raise ValueError("a text or binary field is longer than 65535 bytes")
    return len(value).to_bytes(2) + value


def text(value: str) -> bytes:
    """Return text behind its length."""
    return binary(value.encode())
