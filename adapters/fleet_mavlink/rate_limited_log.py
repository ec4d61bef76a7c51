"""Rate-limited warnings: once a minute for each reason."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

_EVERY = 60.0  # s
_MOST = 100  # reasons
_OTHERS = "others"  # reason that collects all further ones


class RateLimitedLog:
    """Warnings in one log; ``now`` returns monotonic seconds."""

    def __init__(self, log: logging.Logger, now: Callable[[], float]) -> None:
        self._log, self._now = log, now
        self._said: dict[str, float] = {}
        self._since: dict[str, int] = {}

    def add(self, reason: str, line: str) -> bool:
        """Count an event; return whether it was logged now. Text from outside must not become a reason."""
        if reason not in self._said and len(self._said) >= _MOST:
            reason = _OTHERS
        now = self._now()
        if now - self._said.get(reason, -math.inf) < _EVERY:
            self._since[reason] = self._since.get(reason, 0) + 1
            return False
        self._said[reason] = now
        more = self._since.pop(reason, 0)
        self._log.warning("%s%s", line, f" ({more} more since)" if more else "")
        return True
