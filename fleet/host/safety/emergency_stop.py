"""The latched emergency stop: set from any thread, cleared only by an explicit release."""

from __future__ import annotations

from collections.abc import Callable

RELEASE = "release_emergency_stop"


class EmergencyStopLatch:
    """One robot's emergency stop, set from the beginning with a ``why`` of an earlier process.

    ``keep`` is told each change, on any thread: why it is set, or nothing for its release. It may hang, so
    of a stop it is told by ``record``, once the robot was halted. ``held`` says why it cannot be released,
    and why nothing may move although it is not set; empty when nothing holds.
    """

    def __init__(self, why: str = "", keep: Callable[[str], None] = lambda _: None) -> None:
        self._why = why
        self._keep = keep
        self.held = ""
        self._unrecorded = False
        self._told = bool(why)

    def is_news(self) -> bool:
        """Return True once for each time that it was set by this process: then it is to be told."""
        told, self._told = self._told, self.set
        return self.set and not told

    @property
    def set(self) -> bool:
        """True from the stop until its release."""
        return bool(self._why)

    @property
    def why(self) -> str:
        """Why it is set; empty while it is not."""
        return self._why

    def engage(self, why: str) -> None:
        """Stop, in memory; pulling again changes nothing."""
        if not self._why:
            self._why, self._unrecorded = why, True

    def record(self) -> None:
        """Have the stop kept, if it is not yet."""
        if self._unrecorded:
            self._unrecorded = False
            self._keep(self._why)

    def release(self) -> None:
        """Allow motion again; the robot stays as it is until somebody asks for more."""
        self._why, self._unrecorded, self._told = "", False, False
        self._keep("")
        if self._why:  # somebody stopped it meanwhile: that is what is to be remembered
            self._keep(self._why)

    def refusal(self) -> str | None:
        """Return why nothing may move, None when it may."""
        if not self._why:
            return self.held or None
        return f"emergency stop is set ({self._why}); send {RELEASE} first"
