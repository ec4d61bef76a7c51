"""Calls that may block, made on their own threads: a halt, a line for a log that hangs."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable

from fleet.runtime.realtime import prefer_watcher

NAME = "fleet-call"
HALT_WAIT = 0.02  # s that one robot's halt may delay the next one


def run_in_thread(call: Callable[[], None], *, wait: float = 0.0) -> None:
    """Make a call on its own thread, and wait for it at most ``wait`` seconds.

    If no thread can be started, the call is made here. ``call`` must not raise.
    """

    def make() -> None:
        prefer_watcher()
        call()

    thread = threading.Thread(target=make, name=NAME, daemon=True)
    try:
        thread.start()
    except RuntimeError:
        call()
        return
    if wait:
        thread.join(wait)


def call_sequentially(calls: Iterable[Callable[[], None]], *, wait: float) -> None:
    """Make calls one after another on another thread; one that blocks delays the next by at most ``wait`` s.

    A thread per call would be slower on a busy interpreter: each start waits for it several times.
    """
    left = deque(calls)

    def make() -> None:
        while True:
            try:
                call = left.popleft()
            except IndexError:
                return
            call()

    while left:
        run_in_thread(make, wait=wait)
