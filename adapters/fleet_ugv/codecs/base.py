"""Common interface of the codecs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from fleet import LineFraming, Unsupported
from fleet_ugv.model import Motion, UgvEvent


class Codec(ABC):
    """Codec of one open line; create a new one for each. It does not wait, read a clock or do I/O.

    ``stop``: the bytes that stop the wheels in any state of the codec (read from any thread);
    ``gimbal_stop``: those that stop the camera mount where it is, empty for a base without one.
    ``garbage`` counts pieces of input that could not be decoded.
    """

    stop: ClassVar[bytes]
    gimbal_stop: bytes = b""
    garbage: int = 0

    @abstractmethod
    def feed(self, data: bytes) -> Sequence[UgvEvent]:
        """Take received bytes; return the events that they complete. Never raises; garbage is counted."""

    @abstractmethod
    def motion(self, motion: Motion) -> bytes:
        """Return the frame that holds these speeds."""

    def hello(self) -> bytes:
        """Return the greeting of a silent base: the end of a partial line, and a request."""
        return b""

    def setup(self) -> bytes:
        """Return the settings for a board that answers for the first time, or after a restart."""
        return b""

    def poll(self) -> bytes:
        """Return the request for the next feedback."""
        return b""

    def lights(self, chassis: int, camera: int) -> bytes:  # noqa: ARG002 - for overriders
        """Return the frame that sets both lamps, 0 to 255."""
        raise Unsupported("this base has no lamps")

    def gimbal(self, pan: int, tilt: int) -> bytes:  # noqa: ARG002 - for overriders
        """Return the frame that turns the camera: whole degrees, pan right and tilt up positive."""
        raise Unsupported("this base has no camera mount")

    def display(self, lines: Sequence[str]) -> bytes:  # noqa: ARG002 - for overriders
        """Return the frames that write to the display; no lines: restore its own text."""
        raise Unsupported("this base has no display")


class LineCodec(Codec):
    """Codec of a base with a line protocol; lines of more than ``longest`` bytes are dropped."""

    def __init__(self, longest: int) -> None:
        self.garbage = 0
        self._framer = LineFraming(b"\n", longest).framer()

    def feed(self, data: bytes) -> Sequence[UgvEvent]:
        """Take received bytes; return the events of the complete lines."""
        events = map(self._event, self._framer.feed(data))
        return [event for event in events if event is not None]

    @abstractmethod
    def _event(self, line: bytes) -> UgvEvent | None:
        """Decode one line; None when it is no event. Garbage is counted."""
