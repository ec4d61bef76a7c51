"""Who reads what the broker sends while the loop does not: an emergency stop must not wait for the loop."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

logger = logging.getLogger(__name__)

PERIOD = 0.01  # s between looks; what the loop leaves unread from one to the next is read here
BUSY = 0.001  # s after a look that found something


class FallbackReader:
    """A thread that looks again and again; it has nothing to do as long as the loop turns.

    ``look`` returns True when it found something: then more may follow.
    """

    def __init__(self, look: Callable[[], bool]) -> None:
        self._look = look
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fleet-cloud", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def stop(self) -> None:
        """End; a look that is held up is not waited for."""
        self._ended.set()

    def _run(self) -> None:
        """Look until the end, whatever a look runs into."""
        found = False
        while not self._ended.wait(BUSY if found else PERIOD):
            found = False
            try:
                found = self._look()
            except Exception:
                logger.exception("what the loop left unread could not be read")
