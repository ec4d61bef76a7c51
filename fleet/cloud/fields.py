"""Field encodings common to both MQTT versions."""

from __future__ import annotations

import functools


@functools.lru_cache(maxsize=4096)  # packets have few different sizes
def length(size: int) -> bytes:
    """Return the remaining length as a variable byte integer: seven bits a byte, low bits first."""
    pieces = bytearray()
    while True:
        size, low = size >> 7, size & 0x7F
        pieces.append(low | (0x80 if size else 0))
        if not size:
            return bytes(pieces)


def binary(value: bytes) -> bytes:
    """Return binary data with its two-byte length in front."""
    if len(value) > 0xFFFF:
        raise ValueError("a text or binary field is longer than 65535 bytes")
    return len(value).to_bytes(2) + value


def text(value: str) -> bytes:
    """Return a UTF-8 string with its two-byte length in front."""
    return binary(value.encode())
