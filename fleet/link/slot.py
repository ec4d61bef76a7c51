"""The newest motion only: a slot in front of a slow line, so that nothing old waits in a buffer.

A line carries its bytes one after the other, and what is in the kernel cannot be taken back. So motion is
handed over only while no more than one frame is still on its way; until then the slot keeps the newest and
forgets the former. A stop does not wait: it empties the slot and goes out at once, from any thread.
"""

from __future__ import annotations

import threading

from fleet.clock import Clock
from fleet.errors import LinkLost
from fleet.link.base import Link

BITS_A_BYTE = 10  # start, eight, stop


class MotionSlot:
    """What is written to one link. ``frame``: bytes of the longest motion frame; ``baud``: 0 for no pace.

    ``held_back`` counts motion that a newer one replaced before the line was free.
    """

    def __init__(self, link: Link, clock: Clock, *, frame: int, baud: int = 0) -> None:
        self._link = link
        self._clock = clock
        self._frame = frame
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._free_at = 0.0  # monotonic s at which the line has carried all that was written
        self._waiting: bytes | None = None
        self._lock = threading.Lock()  # held for sends only, which never block
        self.turn = 0
        self.held_back = 0

    def put(self, motion: bytes, turn: int) -> bool:
        """Write motion, or keep it until the line is free; from now on it is the newest.

        ``turn`` is the slot's when the motion was decided. False: a stop came in between, it is forgotten.
        Raises LinkLost.
        """
        with self._lock:
            if turn != self.turn:
                return False
            self.held_back += self._waiting is not None
            self._waiting = motion
            self._write_waiting()
            return True

    def flush(self) -> None:
        """Write what waits if the line is free now; call it often. Raises LinkLost."""
        with self._lock:
            self._write_waiting()

    def send(self, data: bytes) -> None:
        """Write what is not motion; raises LinkLost."""
        with self._lock:
            self._write(data)

    def halt(self, stop: bytes) -> bool:
        """Forget all motion and write the stop at once; from any thread. False: the link is gone."""
        with self._lock:
            self.turn += 1
            self._waiting = None
            try:
                self._write(stop)
            except LinkLost:  # then the robot's own fail-safe stops it
                return False
            return True

    def _write_waiting(self) -> None:
        """Write the newest motion unless more than a frame is still under way."""
        if self._waiting is None or self._under_way() > self._frame:
            return
        motion, self._waiting = self._waiting, None
        self._write(motion)

    def _write(self, data: bytes) -> None:
        """Write, and note how long the line is busy with it."""
        if not data:
            return
        self._link.send(data)
        self._free_at = max(self._free_at, self._clock.monotonic()) + len(data) * self._byte_time

    def _under_way(self) -> float:
        """Return the bytes that have not left: those in the kernel, or by the line's own speed if more."""
        unsent = getattr(self._link, "unsent", None)  # only streams can tell
        in_kernel = unsent() if unsent is not None else 0
        if not self._byte_time:
            return in_kernel
        return max(in_kernel, (self._free_at - self._clock.monotonic()) / self._byte_time)
