"""Faults of simulated robots: their notation, and a wire that loses, delays, repeats and corrupts frames.

Written ``loss:0.05,delay:0.2,silent``: names with a number, which defaults to 1.
"""

from __future__ import annotations

import difflib
import heapq
import math
from collections.abc import Iterable, Mapping
from random import Random

WIRE_FAULTS: Mapping[str, str] = {
    "loss": "share of frames that vanish, 0 to 1",
    "delay": "seconds that each frame is late",
    "duplicate": "share of frames that come twice, 0 to 1",
    "reorder": "share of frames that a later one overtakes, 0 to 1",
    "corrupt": "share of frames with a spoiled byte, 0 to 1",
    "silent": "nothing comes through in either direction",
}
_SHARES = frozenset({"loss", "duplicate", "reorder", "corrupt"})
_OVERTAKEN = 0.05  # s by which a reordered frame is delayed


def check_fault(name: str, value: float, known: Mapping[str, str]) -> None:
    """Raise ValueError for an unknown fault, or for a number out of its range."""
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(sorted(known))}"
        raise ValueError(f"there is no fault {name!r}; {hint}")
    if not math.isfinite(value) or value < 0.0 or (name in _SHARES and value > 1.0):
        raise ValueError(f"fault {name}: {value:g} is no {known[name]}")


def parse_faults(text: str, known: Mapping[str, str]) -> dict[str, float]:
    """Parse faults such as ``loss:0.05,silent`` to values by name; raises ValueError with the reason."""
    found: dict[str, float] = {}
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        name, _, number = part.partition(":")
        try:
            value = float(number) if number else 1.0
        except ValueError:
            raise ValueError(f"fault {name}: {number!r} is not a number") from None
        check_fault(name, value, known)
        found[name] = value
    return found


class BadWire:
    """One direction of a wire with faults; without faults it passes frames on at once.

    ``faults`` is read at every call, so it may be changed while frames are in transit.
    """

    def __init__(self, faults: Mapping[str, float], random: Random) -> None:
        self._faults = faults
        self._random = random
        self._inflight: list[tuple[float, int, bytes]] = []
        self._count = 0

    def carry(self, frames: Iterable[bytes], now: float) -> list[bytes]:
        """Send ``frames`` at ``now`` (seconds); return the frames that arrive by then, in that order."""
        if not self._faults and not self._inflight:
            return list(frames)
        for frame in frames:
            self._put(frame, now)
        arrived = []
        while self._inflight and self._inflight[0][0] <= now:
            arrived.append(heapq.heappop(self._inflight)[2])
        return arrived

    def _happens(self, name: str) -> bool:
        share = self._faults.get(name, 0.0)
        return share > 0.0 and self._random.random() < share

    def _put(self, frame: bytes, now: float) -> None:
        """Apply the faults to one frame, and schedule its arrival."""
        if "silent" in self._faults or self._happens("loss"):
            return
        if self._happens("corrupt") and frame:
            place = self._random.randrange(len(frame))
            frame = frame[:place] + bytes([frame[place] ^ 0xFF]) + frame[place + 1 :]
        due = now + self._faults.get("delay", 0.0)
        if self._happens("reorder"):
            due += _OVERTAKEN
        for _ in range(2 if self._happens("duplicate") else 1):
            self._count += 1
            heapq.heappush(self._inflight, (due, self._count, frame))
