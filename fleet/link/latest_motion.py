"""Latest-value slot for motion in front of a slow line, so that no old motion waits in a buffer.

Bytes handed to the kernel cannot be taken back, and a slow line sends them one after the other. So motion is
handed over only while at most one frame is still being sent; until then the slot keeps the newest motion
and discards the previous one. A stop does not wait: it empties the slot and is written at once, from any
thread.
"""

from __future__ import annotations

import threading

from fleet.clock import Clock
from fleet.errors import LinkLost
from fleet.link.base import Address, Link

BITS_A_BYTE = 10  # on a serial line: start bit, eight data bits, stop bit
MotionFrames = tuple[bytes, ...]  # frames that belong together; each is one write


class LatestMotion:
    """Writer of one link. ``baud`` paces motion (0: no pacing); ``peer``: destination address (datagrams).

    ``turn`` counts the stops. ``superseded`` counts motion that was replaced by newer motion before the line
    was free.
    """

    def __init__(self, link: Link, clock: Clock, *, baud: int = 0) -> None:
        self.peer: Address = None
        self.turn = 0
        self.superseded = 0
        self._link = link
        self._clock = clock
        self._byte_time = BITS_A_BYTE / baud if baud else 0.0
        self._free_at = 0.0  # monotonic s at which the line will have sent everything written so far
        self._waiting: MotionFrames = ()
        self._lock = threading.Lock()  # held for sends only, which never block

    def put(self, motion: MotionFrames, turn: int, *, at_once: bool = False) -> bool:
        """Write motion, or keep it as the newest until the line is free.

        ``turn`` is the slot's turn at the time the motion was decided. Returns False when a stop came in
        between: the motion is discarded. ``at_once``: newer motion must not replace it, so it is written
        without waiting for the line. Raises LinkLost.
        """
        with self._lock:
            if turn != self.turn:
                return False
            self.superseded += bool(self._waiting)
            self._waiting = () if at_once else motion
            if at_once:
                self._write(motion)
            else:
                self._write_waiting()
            return True

    def flush(self) -> None:
        """Write the waiting motion if the line is free now; call it often. Raises LinkLost."""
        if self._waiting:
            with self._lock:
                self._write_waiting()

    def send(self, *frames: bytes) -> None:
        """Write frames that are not motion; raises LinkLost."""
        with self._lock:
            self._write(frames)

    def halt(self, stop: MotionFrames) -> bool:
        """Discard all motion and write the stop at once; from any thread.

        False: it was not written, because the link is down or has no peer yet.
        """
        with self._lock:
            self.turn += 1  # motion decided before this stop is refused by ``put``
            self._waiting = ()
            try:
                return self._write(stop)
            except LinkLost:  # the robot's own fail-safe must stop it
                return False

    def _write_waiting(self) -> None:
        """Write the newest motion unless more bytes than its own length are still unsent."""
        if not self._waiting or self._inflight() > sum(map(len, self._waiting)):
            return
        motion, self._waiting = self._waiting, ()
        self._write(motion)

    def _write(self, frames: MotionFrames) -> bool:
        """Write, and update the time at which the line will be free; return False if a frame was dropped."""
        written = [self._link.send(frame, self.peer) for frame in frames if frame]
        if self._byte_time:
            busy = sum(map(len, frames)) * self._byte_time
            self._free_at = max(self._free_at, self._clock.monotonic()) + busy
        return all(written)

    def _inflight(self) -> int:
        """Return the number of unsent bytes: those in the kernel, or those by the line's speed if more."""
        unsent = getattr(self._link, "unsent", None)  # only streams have it
        in_kernel: int = unsent() if unsent is not None else 0
        if not self._byte_time:
            return in_kernel
        return max(in_kernel, round((self._free_at - self._clock.monotonic()) / self._byte_time))
