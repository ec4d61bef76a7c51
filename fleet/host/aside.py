"""Calls that may be held up, made on threads of their own: a halt, a line to a log that is stuck."""

from __future__ import annotations

import threading
from collections.abc import Callable

NAME = "fleet-aside"


def aside(call: Callable[[], None], *, wait: float = 0.0) -> None:
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
