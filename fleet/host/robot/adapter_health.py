"""Health of one robot's run: decides which changes are reported, and at which log level."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from fleet.model.health import Health, Level
from fleet.runtime.exception_barrier import log_exceptions

COMING_UP = 10.0  # s in which the steps of a start are normal: silent line, set-up


class AdapterHealth:
    """The health of a robot, ``now``.

    ``changed`` is called at each change, ``level_changed`` with each new level except the steps of a start.
    The run of the robot does not depend on them: what they raise is logged.
    """

    def __init__(
        self, log: logging.Logger, *, changed: Callable[[], None], level_changed: Callable[[Health], None]
    ) -> None:
        self.now = Health(Level.OFFLINE, "starting")
        self._log = log
        watched = log_exceptions(log, "a change of its health could not be reported")
        self._changed = watched(changed)
        self._level_changed = watched(level_changed)
        self._reported: Level | None = None
        self._start: asyncio.TimerHandle | None = None  # while it runs, levels are steps of a start

    def set(self, health: Health) -> None:
        """Set the health; report it if it changed."""
        if health != self.now:
            self.now = health
            self._log_health()
            self._changed()

    def begin_start(self) -> None:
        """Begin a start: until it ends or takes too long, its steps are logged but not reported."""
        self._start = asyncio.get_running_loop().call_later(COMING_UP, self._start_is_over)

    def end_start(self) -> None:
        """End the start early: later changes are reported at once."""
        if self._start is not None:
            self._start.cancel()
            self._start = None

    def _start_is_over(self) -> None:
        """End a start that takes too long; a remaining problem is reported."""
        self._start = None
        self._log_health()

    def _log_health(self) -> None:
        """Log the health: a new level from degraded up as a warning, everything else as information."""
        level, cause = self.now.level, self.now.cause
        is_new = level is not self._reported and self._start is None
        loud = is_new and level >= Level.DEGRADED
        if is_new:
            self._reported = level
        self._log.log(
            logging.WARNING if loud else logging.INFO, "%s%s", level.word, f": {cause}" * bool(cause)
        )
        if is_new:
            self._level_changed(self.now)
