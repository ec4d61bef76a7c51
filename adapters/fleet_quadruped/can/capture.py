"""The last seconds of a dog's buses, written to a file when a fault latches.

A line for each frame, as ``candump -L`` writes them, with R for what we received and T for what we sent:

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

FRAMES = 20_000  # about 5 s of a dog at 100 cycles a second
FILES = 5  # of one dog; the oldest goes
_LINE = re.compile(r"\((\d+\.\d+)\) (\S+) ([0-9A-F]{3,8})#(R|#1|)((?:[0-9A-F]{2}){0,64}) ([RT])", re.ASCII)


class Captured(NamedTuple):
    """One frame; ``time`` in Unix seconds, ``sent`` by us."""

    time: float
    bus: str
    frame: CanFrame
    sent: bool


class CapturedBus:
    """A bus whose frames are noted in a ring as they come and go."""

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
        """Frames that could not be sent."""
        return getattr(self._bus, "dropped", 0)

    def send(self, frame: CanFrame) -> None:
        """Send a frame, or drop and count it."""
        self._note(Captured(self._clock.time(), self.name, frame, sent=True))
        self._bus.send(frame)

    def receive(self, wait: float) -> list[CanFrame]:
        """Return what has arrived; raises LinkLost."""
        frames = self._bus.receive(wait)
        now = self._clock.time() if frames else 0.0
        for frame in frames:
            self._note(Captured(now, self.name, frame, sent=False))
        return frames

    def _note(self, captured: Captured) -> None:
        """Note a frame."""
        self._ring.append(captured)
        self._also(captured)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()


class Capture:
    """Notes what is on all buses of a dog. ``buses`` are to be used instead of those that are given.

    ``also`` is given each frame as well.
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

    def look(self, fault: str, *, resting: bool) -> str:
        """Note the dog's fault; once it has come to rest, write the file. Return the fault's file, or "".

        Writing waits for the rest, and is done on a thread: a dog that gives way has no time for a disk.
        """
        if not fault:
            self._fault = self.path = ""
        elif fault != self._fault and resting:
            self._fault = fault
            self._begin()
        return self.path

    def finish(self) -> None:
        """Wait until what is being written is on the disk."""
        if self._saving is not None:
            self._saving.join()

    def _begin(self) -> None:
        self.finish()
        path = self._folder / f"{self._clock.time():.3f}.log"
        self.path = str(path)
        self._saving = threading.Thread(target=_save, args=(path, list(self._ring)), name="capture")
        self._saving.start()


def _save(path: Path, frames: list[Captured]) -> None:
    """Write a file, and take away those that are too many."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", encoding="ascii") as file:
            file.writelines(map(_line, frames))
        others = sorted(other for other in path.parent.glob("*.log") if other != path)
        for old in others[: 1 - FILES]:  # never the new one, whatever the clock said before
            old.unlink()
    except OSError as error:
        log.warning("what was on the buses before the fault could not be written: %s", error)
        return
    log.warning("what was on the buses before the fault is in %s", path)


def _line(captured: Captured) -> str:
    frame = captured.frame
    width = 8 if frame.extended else 3
    way = "T" if captured.sent else "R"
    mark = "R" if frame.remote else "#1" if frame.fd else ""
    data = f"{frame.id:0{width}X}#{mark}{frame.data.hex().upper()}"
    return f"({captured.time:.6f}) {captured.bus} {data} {way}\n"


def read_capture(path: Path) -> Iterator[Captured]:
    """Yield the frames of a file; raises ConfigError naming the line that is none."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is no candump log") from None
    for number, line in enumerate(lines, start=1):
        match = _LINE.fullmatch(line)
        if match is None:
            raise ConfigError(f"{path}:{number}: is no line of a candump log: {line[:60]!r}")
        time, bus, identifier, mark, data, way = match.groups()
        frame = CanFrame(int(identifier, 16), bytes.fromhex(data), mark == "#1", mark == "R")
        yield Captured(float(time), bus, frame, way == "T")
