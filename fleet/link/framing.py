"""Framing: cuts a byte stream into frames, with a length limit so that garbage cannot fill memory."""

from __future__ import annotations

from typing import Protocol


class Framer(Protocol):
    """Framing state of one stream."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take received bytes; return the frames that they complete."""


class Framing(Protocol):
    """A framing rule; makes a new framer for each opened link."""

    def framer(self) -> Framer:
        """Return an empty framer."""


class LineFraming:
    """Frames are lines, without their ending; a line longer than ``limit`` bytes is skipped."""

    def __init__(self, ending: bytes = b"\n", limit: int = 4096) -> None:
        self.ending = ending
        self.limit = limit

    def framer(self) -> Framer:
        """Return an empty framer."""
        return _LineFramer(self.ending, self.limit)


class _LineFramer:
    """Collects bytes up to the line ending."""

    def __init__(self, ending: bytes, limit: int) -> None:
        self._ending = ending
        self._limit = limit
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take received bytes; return the complete lines."""
        *lines, self._rest = (self._rest + data).split(self._ending)
        if self._skipping and lines:
            del lines[0]
            self._skipping = False
        if len(self._rest) > self._limit:
            # Drop the overlong line, but keep what may be the first bytes of its ending.
            self._rest = self._rest[-len(self._ending) + 1 :] if len(self._ending) > 1 else b""
            self._skipping = True
        return [line.rstrip(b"\r") for line in lines if 0 < len(line) <= self._limit]


class DatagramFraming:
    """Each received piece is a frame (datagrams)."""

    def framer(self) -> Framer:
        """Return a framer that passes each piece through."""
        return _DatagramFramer()


class _DatagramFramer:
    """Returns each piece as one frame."""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the piece."""
        return [data] if data else []
