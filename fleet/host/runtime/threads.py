"""Calls that may be held up, made on threads of their own: a halt, a line to a log that is stuck."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable

NAME = "fleet-aside"
HALT_WAIT = 0.02  # s that one robot's halt may keep who makes it from the next robot


def run_in_thread(call: Callable[[], None], *, wait: float = 0.0) -> None:
    """Make a call on a thread of its own, and wait for it at most ``wait`` seconds.

    Where no thread is to be had, it is made here. ``call`` must not raise.
    """
    thread = threading.Thread(target=call, name=NAME, daemon=True)
    try:
        thread.start()
    except RuntimeError:
        call()
        return
    if wait:
        thread.join(wait)


def run_in_turn(calls: Iterable[Callable[[], None]], *, wait: float) -> None:
    """Make calls one after another on a thread beside; one that is held up keeps the next at most ``wait`` s.

    A thread for each call would be late on a busy interpreter: each start waits for it several times.
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
