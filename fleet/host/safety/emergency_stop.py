"""Latched emergency stop: set from any thread, cleared only by an explicit release."""

from __future__ import annotations

from collections.abc import Callable

RELEASE = "release_emergency_stop"


class EmergencyStopLatch:
    """Emergency stop of one robot; set from the start if an earlier process left a ``why``.

    ``keep(why)`` writes each change to the journal, from any thread; an empty text is the release. It may
    block, so ``record`` calls it for a stop only after the robot was halted. ``held`` is the reason for which
    the stop cannot be released and nothing may move, such as a stop input without heartbeat; else empty.
    """

    def __init__(self, why: str = "", keep: Callable[[str], None] = lambda _: None) -> None:
        self._why = why
        self._keep = keep
        self.held = ""
        self.requested = 0  # number of stop requests in this process
        self._unrecorded = False
        self._reported = bool(why)

    def is_first_report(self) -> bool:
        """Return True once for each stop set in this process, so that each is reported once."""
        was_reported, self._reported = self._reported, self.set
        return self.set and not was_reported

    @property
    def set(self) -> bool:
        """True from the stop until its release."""
        return bool(self._why)

    @property
    def cause(self) -> str:
        """Cause of the stop; empty while it is not set."""
        return self._why

    def engage(self, why: str) -> None:
        """Set the stop in memory; the first cause stays while it is set."""
        self.requested += 1
        if not self._why:
            self._why, self._unrecorded = why, True

    def record(self) -> None:
        """Write the stop to the journal unless it is there already."""
        if self._unrecorded:
            self._unrecorded = False
            self._keep(self._why)

    def release(self) -> None:
        """Clear the stop; motion needs a new command."""
        self._why, self._unrecorded, self._reported = "", False, False
        self._keep("")
        if self._why:  # set again by another thread while ``keep`` wrote the release: the stop must be last
            self._keep(self._why)

    def refusal(self) -> str | None:
        """Return why nothing may move; None when motion is possible."""
        if not self._why:
            return self.held or None
        return f"emergency stop is set ({self._why}); release it first: fleet release, or {RELEASE}"
