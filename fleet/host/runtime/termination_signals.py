"""Signals that end a process with robots, and SIGTSTP, which must not suspend it."""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable

log = logging.getLogger(__name__)


def end_by_signal(end: Callable[[], None]) -> None:
    """Call ``end`` on Ctrl-C, on SIGTERM, and when the terminal is closed, unless under nohup.

    Ctrl-Z only logs a warning: suspended, a moving robot would be without its host and its dead-man.
    """
    loop = asyncio.get_running_loop()
    hangs_up = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    for number in (signal.SIGINT, signal.SIGTERM, *[signal.SIGHUP] * hangs_up):
        loop.add_signal_handler(number, end)
    loop.add_signal_handler(signal.SIGTSTP, log.warning, "not suspended: its robots need it; Ctrl-C ends it")
