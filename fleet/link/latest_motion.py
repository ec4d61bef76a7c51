"""The newest motion only: a slot in front of a slow line, so that nothing old waits in a buffer.

A line carries its bytes one after the other, and what is in the kernel cannot be taken back. So motion is
handed over only while no more than one frame is still on its way; until then the slot keeps the newest and
forgets the former. A stop does not wait: it empties the slot and goes out at once, from any thread.
"""

from __future__ import annotations

import threading

from fleet.clock import Clock
from fleet.errors import LinkLost
from fleet.link.base import Address, Link

BITS_A_BYTE = 10  # start, eight, stop
Frames = tuple[bytes, ...]  # what belongs together; each is written by itself


class LatestMotion:
    """What is written to one link. ``baud``: 0 for no pace; ``peer``: to whom (datagrams).

    ``held_back`` counts motion that a newer one replaced before the line was free.
    """

    def __init__(self, link: Link, clock: Clock, *, baud: int = 0) -> None:
        self.peer: Address = None
        self.turn = 0
        self.held_back = 0
        self._link = link
        self._clock = clock
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._free_at = 0.0  # monotonic s at which the line has carried all that was written
        self._waiting: Frames = ()
        self._lock = threading.Lock()  # held for sends only, which never block

    def put(self, motion: Frames, turn: int, *, at_once: bool = False) -> bool:
        """Write motion, or keep it until the line is free; from now on it is the newest.

        ``turn`` is the slot's when the motion was decided. False: a stop came in between, it is forgotten.
        ``no_wait``: it must not be replaced by newer motion, so it does not wait. Raises LinkLost.
        """
        with self._lock:
            if turn != self.turn:
                return False
            self.held_back += bool(self._waiting)
            self._waiting = () if at_once else motion
            if at_once:
                self._write(motion)
            else:
                self._write_waiting()
            return True

    def flush(self) -> None:
        """Write what waits if the line is free now; call it often. Raises LinkLost."""
        if self._waiting:
            with self._lock:
                self._write_waiting()

    def send(self, *frames: bytes) -> None:
        """Write what is not motion; raises LinkLost."""
        with self._lock:
            self._write(frames)

    def halt(self, stop: Frames) -> bool:
        """Forget all motion and write the stop at once; from any thread. False: the link is gone."""
        with self._lock:
            self.turn += 1
            self._waiting = ()
            try:
                self._write(stop)
            except LinkLost:  # then the robot's own fail-safe stops it
                return False
            return True

    def _write_waiting(self) -> None:
        """Write the newest motion unless more than its own length is still under way."""
        if not self._waiting or self._inflight() > sum(map(len, self._waiting)):
            return
        motion, self._waiting = self._waiting, ()
        self._write(motion)

    def _write(self, frames: Frames) -> None:
        """Write, and note how long the line is busy with it."""
        for frame in frames:
            if frame:
                self._link.send(frame, self.peer)
        if self._byte_time:
            busy = sum(map(len, frames)) * self._byte_time
            self._free_at = max(self._free_at, self._clock.monotonic()) + busy

    def _inflight(self) -> int:
        """Return the bytes that have not left: those in the kernel, or by the line's own speed if more."""
        unsent = getattr(self._link, "unsent", None)  # only streams can tell
        in_kernel: int = unsent() if unsent is not None else 0
        if not self._byte_time:
            return in_kernel
        return max(in_kernel, round((self._free_at - self._clock.monotonic()) / self._byte_time))
