"""The recorder: collects samples from the bus's threads, and writes them to the files of a ring."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from pathlib import Path

from fleet.clock import Clock
from fleet.errors import StateError
from fleet.history.record import Record
from fleet.record.ring import Ring
from fleet.record.samples import SampleReader, event_message

log = logging.getLogger(__name__)

MOST_WAITING = 64 * 1024 * 1024
"""Bytes that may wait for the disk; further samples are dropped and counted."""
AGAIN = 10.0  # s between retries of a failed disk


class Recorder:
    """Records the arguments of ``add`` and ``add_events``, from any thread; one thread calls ``write``.

    ``problem``: why nothing is recorded, or what was lost; empty if all is well.
    """

    def __init__(self, ring: Ring, clock: Clock) -> None:
        self.problem = ""
        self.recorded = 0
        self._ring = ring
        self._clock = clock
        self._reader = SampleReader()
        self._lock = threading.Lock()
        self._samples: list[tuple[int, str, str, bytes]] = []
        self._events: list[tuple[int, str, Record]] = []
        self._waiting = 0
        self._dropped = 0
        self._not_before = float("-inf")
        self._path: Path | None = None

    def add(self, edge: str, key: str, payload: bytes) -> None:
        """Add a sample from the bus of an edge; an empty one is ignored."""
        self.add_many(edge, ((key, payload),))

    def add_many(self, edge: str, samples: Iterable[tuple[str, bytes]]) -> None:
        """Add samples from the bus of an edge."""
        with self._lock:
            for key, payload in samples:
                if self._waiting + len(payload) > MOST_WAITING:
                    self._dropped += 1
                elif payload:
                    self._waiting += len(payload)
                    self._samples.append((self._now(), edge, key, payload))

    def add_events(self, edge: str, events: list[Record]) -> None:
        """Add events of an edge's history."""
        with self._lock:
            self._events += [(self._now(), edge, event) for event in events]

    def _now(self) -> int:
        """Return Unix nanoseconds."""
        return round(self._clock.time() * 1e9)

    def write(self) -> None:
        """Write the collected samples to disk; a disk error is reported in ``problem`` and retried."""
        with self._lock:
            samples, self._samples = self._samples, []
            events, self._events = self._events, []
            dropped, self._dropped = self._dropped, 0
            self._waiting = 0
        if self._clock.monotonic() < self._not_before:
            return
        try:
            self._record(samples, events)
        except (OSError, StateError) as error:
            self._fail(error)
        else:
            self._set_problem(self._losses(dropped))

    def _losses(self, dropped: int) -> str:
        """Describe the losses; ``dropped`` samples exceeded the limit."""
        frames = self._reader.take_lost()
        if dropped:
            return f"{dropped} samples were not recorded: the disk of {self._ring.folder} is too slow"
        return f"{frames} frames of links were not recorded: there were too many" if frames else ""

    def _record(
        self, samples: list[tuple[int, str, str, bytes]], events: list[tuple[int, str, Record]]
    ) -> None:
        """Write to the file in progress; raises OSError and StateError."""
        if not samples and not events:
            return
        file = self._ring.file(self._clock.time())
        if file.path != self._path:  # each file starts with the persistent values, so it can be read alone
            self._path = file.path
            for message in self._reader.persistent_values:
                file.add(message, self._now())
        for received, edge, key, payload in samples:
            for message in self._reader.read(edge, key, payload):
                file.add(message, received)
                self.recorded += 1
        for received, edge, event in events:
            file.add(event_message(edge, event), received)
            self.recorded += 1
        file.flush()

    def _fail(self, error: Exception) -> None:
        """End the file in progress, and wait before the disk is retried."""
        self._ring.end_file()
        self._not_before = self._clock.monotonic() + AGAIN
        reason = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
        self._set_problem(reason if isinstance(error, StateError) else f"nothing is recorded: {reason}")

    def _set_problem(self, problem: str) -> None:
        """Set the problem, and log a new one."""
        if problem and problem != self.problem:
            log.error("%s", problem)
        self.problem = problem

    def close(self) -> None:
        """Write the collected samples, and end the file."""
        self.write()
        self._ring.close()
