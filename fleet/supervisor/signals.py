"""Signals that the supervisor handles and forwards to the edge."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator

PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)


@contextlib.contextmanager
def handled_signals(handle: Callable[[int], None]) -> Iterator[None]:
    """Handle the signals in ``PASSED_ON``; an ignored one (SIGHUP under nohup) stays ignored."""
    taken = [each for each in PASSED_ON if signal.getsignal(each) is not signal.SIG_IGN]
    before = {each: signal.signal(each, lambda number, _: handle(number)) for each in taken}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
