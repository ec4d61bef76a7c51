"""Redaction of secrets in recorded MAVLink bytes: the key in SETUP_SIGNING.

Source: https://mavlink.io/en/messages/common.html#SETUP_SIGNING (256, MAVLink 2 only) and
https://mavlink.io/en/guide/serialization.html.
"""

from __future__ import annotations

import re

_HEADER = 10  # bytes before the payload of a MAVLink 2 frame
_CHECKSUM = 2  # bytes
_SETUP_SIGNING = re.compile(rb"\xfd(.).{5}\x00\x01\x00", re.DOTALL)
"""Start of a frame with the message id 256; the group is the length of its payload."""


class SigningKeyRedaction:
    """Sets payload and checksum of each SETUP_SIGNING to zero, in one direction of one link.

    It searches for the header at any offset, not frame by frame, so that damaged bytes before it cannot hide
    a key. A frame may be split into pieces of any length.
    """

    def __init__(self) -> None:
        self._tail = b""  # last bytes of the previous piece, in which a header may have begun
        self._left = 0  # bytes at the beginning of the next piece that belong to a key

    def __call__(self, data: bytes) -> bytes:
        """Return the redacted bytes, as many as were given."""
        before = len(self._tail)
        raw = self._tail + data
        shown = bytearray(raw)
        secret = min(self._left, len(data))
        shown[before : before + secret] = bytes(secret)
        self._left -= secret
        at = 0
        while (found := _SETUP_SIGNING.search(raw, at)) is not None:
            at = found.start() + 1
            begin = found.start() + _HEADER
            end = begin + found[1][0] + _CHECKSUM
            inside = min(end, len(raw))
            shown[begin:inside] = bytes(inside - begin)
            self._left = max(self._left, end - len(raw))
        self._tail = raw[-_HEADER + 1 :]  # too short for a whole header, so that each is found once
        return bytes(shown[before:])
