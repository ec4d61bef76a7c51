"""Ring buffer of the last seconds on a robot's buses, written to a file when a fault latches.

One line per frame, in the format of ``candump -L``, with R for received and T for transmitted frames:

    (1795000000.123456) a 188#371210A4000006FF R
    (1795000000.123456) a 021#R T                       a remote frame
    (1795000000.123456) a 00008001##101000A T           CAN FD, with the flags 1: at the data bit rate
"""

from __future__ import annotations

import logging
import re
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from fleet import CanBus, CanFrame, Clock, ConfigError

log = logging.getLogger(__name__)

FRAMES = 20_000  # about 5 s at 100 cycles a second
FILES = 5  # files kept per robot; the oldest is deleted
_LINE = re.compile(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]{3,8})#(R|#1|)((?:[0-9A-F]{2}){0,64}) ([RT])", re.ASCII)


class Captured(NamedTuple):
    """One frame; ``time`` in Unix seconds, ``sent`` if we transmitted it."""

    time: float
    bus: str
    frame: CanFrame
    sent: bool


class CapturedBus:
    """A bus that appends each frame to a ring buffer."""

    def __init__(
        self, bus: CanBus, ring: deque[Captured], clock: Clock, also: Callable[[Captured], None]
    ) -> None:
        self.name = bus.name
        self._also = also
        self._bus = bus
        self._ring = ring
        self._clock = clock

    @property
    def dropped(self) -> int:
        """Number of frames that could not be sent."""
        return getattr(self._bus, "dropped", 0)

    def send(self, frame: CanFrame) -> None:
        """Send a frame, or drop and count it."""
        self._note(Captured(self._clock.time(), self.name, frame, sent=True))
        self._bus.send(frame)

    def receive(self, wait: float) -> list[CanFrame]:
        """Return the received frames; raises LinkLost."""
        frames = self._bus.receive(wait)
        now = self._clock.time() if frames else 0.0
        for frame in frames:
            self._note(Captured(now, self.name, frame, sent=False))
        return frames

    def _note(self, captured: Captured) -> None:
        """Append a frame to the ring and pass it to the other consumer."""
        self._ring.append(captured)
        self._also(captured)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()


class Capture:
    """Captures the frames of all buses of a robot. Use ``buses`` instead of the given ones.

    Each frame is also passed to ``also``.
    """

    def __init__(
        self,
        buses: Mapping[str, CanBus],
        folder: Path,
        clock: Clock,
        also: Callable[[Captured], None] = lambda _captured: None,
    ) -> None:
        self._ring: deque[Captured] = deque(maxlen=FRAMES)
        self.buses: dict[str, CanBus] = {
            name: CapturedBus(bus, self._ring, clock, also) for name, bus in buses.items()
        }
        self._folder = folder
        self._clock = clock
        self._fault = ""
        self._saving: threading.Thread | None = None
        self.path = ""

    def update(self, fault: str, *, resting: bool) -> str:
        """Follow the latched fault; write the file once the robot is at rest. Return its path, or "" so far.

        Writing waits for the rest and runs on a thread: disk access must not delay the cycles of a hard stop.
        """
        if not fault:
            self._fault = self.path = ""
        elif fault != self._fault and resting:
            self._fault = fault
            self._begin()
        return self.path

    def finish(self) -> None:
        """Wait until the current file is written."""
        if self._saving is not None:
            self._saving.join()

    def _begin(self) -> None:
        self.finish()
        path = self._folder / f"{self._clock.time():.3f}.log"
        self.path = str(path)
        self._saving = threading.Thread(target=_save, args=(path, list(self._ring)), name="capture")
        self._saving.start()


def _save(path: Path, frames: list[Captured]) -> None:
    """Write a file and delete the oldest ones beyond the limit."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", encoding="ascii") as file:
            file.writelines(map(_line, frames))
        others = sorted(other for other in path.parent.glob("*.log") if other != path)
        for old in others[: 1 - FILES]:  # never the new one, even if the clock was set back
            old.unlink()
    except OSError as error:
        log.warning("the bus traffic before the fault could not be written: %s", error)
        return
    log.warning("the bus traffic before the fault is in %s", path)


def _line(captured: Captured) -> str:
    frame = captured.frame
    width = 8 if frame.extended else 3
    direction = "T" if captured.sent else "R"
    mark = "R" if frame.remote else "#1" if frame.fd else ""
    data = f"{frame.id:0{width}X}#{mark}{frame.data.hex().upper()}"
    return f"({captured.time:.6f}) {captured.bus} {data} {direction}\n"


def read_capture(path: Path) -> Iterator[Captured]:
    """Yield the frames of a file; raises ConfigError with the number of an invalid line."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not a candump log") from None
    for number, line in enumerate(lines, start=1):
        match = _LINE.fullmatch(line)
        if match is None:
            raise ConfigError(f"{path}:{number}: is not a line of a candump log: {line[:60]!r}")
        time, bus, identifier, mark, data, direction = match.groups()
        frame = CanFrame(int(identifier, 16), bytes.fromhex(data), mark == "#1", mark == "R")
        yield Captured(float(time), bus, frame, direction == "T")
