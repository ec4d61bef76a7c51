"""Health of one robot's run: which of its changes are told, and how loudly they are logged."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from fleet.model.health import Health, Level

COMING_UP = 10.0  # s in which the steps of a start are no trouble: a line that is silent yet, a set-up


class RunHealth:
    """The health of a robot ``now``.

    ``changed`` hears of each change, ``level_changed`` of each new level, but for the steps of a start.
    """

    def __init__(
        self, log: logging.Logger, *, changed: Callable[[], None], level_changed: Callable[[Health], None]
    ) -> None:
        self.now = Health(Level.OFFLINE, "starting")
        self._log = log
        self._changed = changed
        self._level_changed = level_changed
        self._told: Level | None = None
        self._start: asyncio.TimerHandle | None = None  # while it runs, levels are steps of a start

    def set(self, health: Health) -> None:
        """Note a health, and tell it if it is another."""
        if health != self.now:
            self.now = health
            self._tell()
            self._changed()

    def begin_start(self) -> None:
        """Begin a start: its steps are logged, and its levels not told, until it ends or takes too long."""
        self._start = asyncio.get_running_loop().call_later(COMING_UP, self._start_is_over)

    def end_start(self) -> None:
        """End the start early: what follows is told at once."""
        if self._start is not None:
            self._start.cancel()
            self._start = None

    def _start_is_over(self) -> None:
        """End a start that takes too long: what is still wrong after it is told."""
        self._start = None
        self._tell()

    def _tell(self) -> None:
        """Log the health: the first of a level aloud, what follows on it and the steps of a start quietly."""
        level, cause = self.now.level, self.now.cause
        is_new = level is not self._told and self._start is None
        loud = is_new and level >= Level.DEGRADED
        if is_new:
            self._told = level
        self._log.log(
            logging.WARNING if loud else logging.INFO, "%s%s", level.word, f": {cause}" * bool(cause)
        )
        if is_new:
            self._level_changed(self.now)
