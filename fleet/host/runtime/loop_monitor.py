"""Whose code the event loop is in, seen from another thread: for the watchdog, to name who blocks it."""

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


class LoopMonitor:
    """The thread that runs ``loop``; made on it."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._ident = threading.get_ident()
        self.cpu = _cpu_of(self._ident)
        self.waited = _waited_of(threading.get_native_id())

    def frame(self) -> FrameType | None:
        """Return where the thread is."""
        return sys._current_frames().get(self._ident)  # noqa: SLF001 - there is no public way

    def owner(self) -> str:
        """Return the robot on whose behalf the loop runs what it is in, empty when it is nobody's.

        Tasks, timers and the callbacks of links know their owners; other callbacks are nobody's.
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
        own = [entry for entry in stack if not _is_library(entry.filename)]
        last = own[-1] if own else stack[-1]
        return f"{Path(last.filename).name}:{last.lineno} in {last.name}"


class LoopSilence:
    """How long an event loop has been silent through its own fault; looked at every ``period`` seconds.

    A process that does not get the processor is silent too. Then this thread is late as well, so only the
    time counts in which it was awake, or in which the loop's thread itself used the processor (a call that
    keeps the interpreter to itself makes this thread late, too).
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._beat = 0.0
        self._awake = 0.0
        self._looked = 0.0
        self._cpu = 0.0
        self._waited = 0.0
        self.blamed = 0.0  # s of it that are somebody's fault in here: the loop could have gone on

    def look(self, now: float, beat: float, cpu: float, waited: float) -> float:
        """Return the seconds of silence that count, at ``now`` (monotonic s).

        ``beat``: the loop's last turn (monotonic s); ``cpu`` and ``waited``: of its thread, as
        ``LoopMonitor`` tells them.
        """
        if beat != self._beat:
            self._beat, self._cpu, self._waited = beat, cpu, waited
            self._awake, self._looked = 0.0, now
        self._awake += min(now - self._looked, 2 * self._period)
        self._looked = now
        silent = min(now - beat, max(self._awake, cpu - self._cpu))
        self.blamed = max(silent - (waited - self._waited), cpu - self._cpu)
        return silent


def _is_library(filename: str) -> bool:
    """Return True for code that only carries out what somebody else asked."""
    return "/lib/python3" in filename and "/site-packages/" not in filename


def _waited_of(number: int) -> Callable[[], float]:
    """Return what tells the seconds that a thread was ready to run and had no processor; else always 0.

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
    """Return what tells the CPU seconds that a thread has used; always 0 where the system does not say."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return lambda: 0.0
    clock = time.pthread_getcpuclockid(ident)
    return lambda: time.clock_gettime(clock)
