"""How a stream of bytes is cut into frames, with a bound so that garbage cannot fill memory."""

from __future__ import annotations

from typing import Protocol


class Framer(Protocol):
    """The state of cutting one stream."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take what arrived; return the frames it completes."""


class Framing(Protocol):
    """A way to cut; makes a fresh cutter for each opened link."""

    def cutter(self) -> Framer:
        """Return a cutter with nothing in it."""


class LineFraming:
    """Frames are lines; the ending is not part of the frame; longer lines are skipped to the next."""

    def __init__(self, ending: bytes = b"\n", limit: int = 4096) -> None:
        self.ending = ending
        self.limit = limit

    def cutter(self) -> Framer:
        """Return a cutter with nothing in it."""
        return _LineCutter(self.ending, self.limit)


class _LineCutter:
    """Collects bytes up to the ending."""

    def __init__(self, ending: bytes, limit: int) -> None:
        self._ending = ending
        self._limit = limit
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take what arrived; return the whole lines."""
        *lines, self._rest = (self._rest + data).split(self._ending)
        if self._skipping and lines:
            del lines[0]
            self._skipping = False
        if len(self._rest) > self._limit:
            self._rest = self._rest[-len(self._ending) + 1 :] if len(self._ending) > 1 else b""
            self._skipping = True
        return [line.rstrip(b"\r") for line in lines if 0 < len(line) <= self._limit]


class DatagramFraming:
    """Each piece that arrives is a frame (datagrams)."""

    def cutter(self) -> Framer:
        """Return a cutter that cuts nothing."""
        return _WholeCutter()


class _WholeCutter:
    """Passes pieces on as they are."""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the piece."""
        return [data] if data else []
