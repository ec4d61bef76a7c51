"""Fallback reader: reads from the broker while the loop does not, because an emergency stop must not wait."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from fleet.runtime.realtime import prefer_watcher

logger = logging.getLogger(__name__)

PERIOD = 0.01  # s between two checks; data that the loop leaves unread for so long is read here
BUSY = 0.001  # s after a check that found data


class FallbackReader:
    """A thread that checks for unread data; it has nothing to do while the loop runs.

    ``poll`` returns True when it found data: more may follow.
    """

    def __init__(self, poll: Callable[[], bool]) -> None:
        self._poll = poll
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fleet-cloud", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread, without waiting for a check in progress."""
        self._ended.set()

    def _run(self) -> None:
        """Check until stopped; an error in one check must not end the thread."""
        prefer_watcher()
        found = False
        while not self._ended.wait(BUSY if found else PERIOD):
            found = False
            try:
                found = self._poll()
            except Exception:
                logger.exception("the fallback reader failed")
