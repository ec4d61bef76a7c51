"""What every codec does, whatever its base speaks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from fleet import LineFraming, Unsupported
from fleet_ugv.model import Event, Motion


class Codec(ABC):
    """Translates for one open line; a fresh one for each. Nothing in it waits, reads a clock or does I/O.

    ``stop``: the bytes that stop the wheels, whatever state the codec is in (read from any thread);
    ``gimbal_stop``: those that stop the camera's mount where it is, empty for a base without one.
    ``garbage`` counts pieces that made no sense.
    """

    stop: ClassVar[bytes]
    gimbal_stop: bytes = b""
    garbage: int = 0

    @abstractmethod
    def feed(self, data: bytes) -> Sequence[Event]:
        """Take what arrived; return what it completes. Never raises; what makes no sense is counted."""

    @abstractmethod
    def motion(self, motion: Motion) -> bytes:
        """Return the frame that holds these speeds."""

    def hello(self) -> bytes:
        """Return what is said until the base speaks: the end of half a line, and a question."""
        return b""

    def setup(self) -> bytes:
        """Return what a board is told once it answers, and again after it restarted."""
        return b""

    def poll(self) -> bytes:
        """Return what asks for the next feedback."""
        return b""

    def lights(self, chassis: int, camera: int) -> bytes:  # noqa: ARG002 - for overriders
        """Return what sets both lamps, 0 to 255."""
        raise Unsupported("this base has no lamps")

    def gimbal(self, pan: int, tilt: int) -> bytes:  # noqa: ARG002 - for overriders
        """Return what turns the camera: whole degrees, pan right and tilt up positive."""
        raise Unsupported("this base has no camera mount")

    def display(self, lines: Sequence[str]) -> bytes:  # noqa: ARG002 - for overriders
        """Return what writes on the display; no lines: its own text again."""
        raise Unsupported("this base has no display")


class LineCodec(Codec):
    """A codec of a base that speaks lines, of ``longest`` bytes at most; what is longer is dropped."""

    def __init__(self, longest: int) -> None:
        self.garbage = 0
        self._cutter = LineFraming(b"\n", longest).cutter()

    def feed(self, data: bytes) -> Sequence[Event]:
        """Take what arrived; return what the whole lines say."""
        events = map(self._event, self._cutter.feed(data))
        return [event for event in events if event is not None]

    @abstractmethod
    def _event(self, line: bytes) -> Event | None:
        """Return what one line says, None for nothing; what makes no sense is counted."""
