"""Shows other threads what code the event loop is executing; the watchdog names a blocking robot by it."""

from __future__ import annotations

import asyncio
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from fleet.runtime.event_loop import OwnedCall, OwnedTask
from fleet.runtime.exception_barrier import is_standard_library


class LoopMonitor:
    """Monitor of the thread that runs ``loop``; created on that thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._ident = threading.get_ident()
        self.cpu = _cpu_of(self._ident)
        self.waited = _waited_of(threading.get_native_id())

    def frame(self) -> FrameType | None:
        """Return the thread's present stack frame."""
        return sys._current_frames().get(self._ident)  # noqa: SLF001 - there is no public way

    def owner(self) -> str:
        """Return the robot for which the loop is executing code; empty for the host's own.

        Tasks, timers and the callbacks of links know their owners; other callbacks belong to the host.
        """
        task = asyncio.current_task(self._loop)
        if isinstance(task, OwnedTask):
            return task.owner
        frame = self.frame()
        while frame is not None and frame.f_code is not OwnedCall.__call__.__code__:
            frame = frame.f_back
        return "" if frame is None else str(frame.f_locals["self"].owner)

    def place(self) -> str:
        """Return the innermost place outside the standard library, as file:line in function."""
        frame = self.frame()
        if frame is None:
            return "an unknown place"
        stack = traceback.extract_stack(frame)
        own = [entry for entry in stack if not is_standard_library(Path(entry.filename))]
        last = own[-1] if own else stack[-1]
        return f"{Path(last.filename).name}:{last.lineno} in {last.name}"


class LoopSilence:
    """Duration for which an event loop has been silent by its own fault; checked every ``period`` seconds.

    A process without processor time is silent too, but then this thread is late as well. So only time counts
    in which this thread was awake, or in which the loop's thread used the processor: a call that holds the
    interpreter lock makes this thread late, too.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._beat = 0.0
        self._awake = 0.0
        self._looked = 0.0
        self._cpu = 0.0
        self._waited: float | None = None  # None until it is read
        self.attributable = 0.0  # s of it in which the loop could have run but did not

    def update(self, now: float, beat: float, cpu: float, waited: Callable[[], float]) -> float:
        """Return the seconds of silence that count, at ``now`` (monotonic s).

        ``beat``: the loop's last tick (monotonic s); ``cpu`` and ``waited``: totals of its thread, from
        ``LoopMonitor``. ``waited`` is called only once the loop has been silent for two periods: it reads a
        file, for which a thread gives the interpreter lock away and takes it from the loop again.
        """
        if beat != self._beat:
            self._beat, self._cpu, self._waited = beat, cpu, None
            self._awake, self._looked = 0.0, now
        self._awake += min(now - self._looked, 2 * self._period)
        self._looked = now
        silent = min(now - beat, max(self._awake, cpu - self._cpu))
        lacked = self._lacked(waited) if silent > 2 * self._period else 0.0
        self.attributable = max(silent - lacked, cpu - self._cpu)
        return silent

    def _lacked(self, waited: Callable[[], float]) -> float:
        """Return the seconds without a processor since this was first called in this silence."""
        total = waited()
        if self._waited is None:
            self._waited = total
        return total - self._waited


def _waited_of(number: int) -> Callable[[], float]:
    """Return a function for the seconds that a thread was runnable without a processor; 0 where unknown.

    Source: the second number of /proc/self/task/TID/schedstat, ns (Linux, Documentation/scheduler).
    """
    path = Path(f"/proc/self/task/{number}/schedstat")

    def waited() -> float:
        try:
            return int(path.read_text().split()[1]) / 1e9
        except (OSError, ValueError, IndexError):
            return 0.0

    return waited


def _cpu_of(ident: int) -> Callable[[], float]:
    """Return a function for the CPU seconds that a thread has used; 0 where unknown."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return lambda: 0.0
    clock = time.pthread_getcpuclockid(ident)
    return lambda: time.clock_gettime(clock)
