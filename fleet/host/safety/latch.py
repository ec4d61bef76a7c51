"""The latched emergency stop: set from any thread, cleared only by an explicit release."""

from __future__ import annotations

RELEASE = "release_emergency_stop"


class Latch:
    """One robot's emergency stop."""

    def __init__(self) -> None:
        self._why = ""

    @property
    def set(self) -> bool:
        """True from the stop until its release."""
        return bool(self._why)

    def pull(self, why: str) -> None:
        """Stop; pulling again changes nothing."""
        self._why = self._why or why

    def release(self) -> None:
        """Allow motion again; the robot stays as it is until somebody asks for more."""
        self._why = ""

    def refusal(self) -> str | None:
        """Return why nothing may move, None when it may."""
        if not self._why:
            return None
        return f"emergency stop is set ({self._why}); send {RELEASE} first"
