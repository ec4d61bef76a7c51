"""Who has the robot: the last one to move it keeps it for a while, so that two cannot fight over it.

Stops pass from anyone. Teleoperation takes the robot from navigation; nothing takes it from a person but
time.
"""

from __future__ import annotations


class ControlLease:
    """One robot's lease; ``seconds`` after the holder's last motion it is free."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._holder = ""
        self._until = float("-inf")

    def refusal(self, session: str, now: float) -> str | None:
        """Return why this session may not move the robot now, None when it may."""
        if now >= self._until or session == self._holder:
            return None
        return f"{self._holder or 'another operator'} has control for {self._until - now:.1f} s more"

    def take(self, session: str, now: float) -> None:
        """Give the robot to this session from now on."""
        self._holder = session
        self._until = now + self._seconds

    def let_go(self, session: str) -> None:
        """End the lease of this session, if it is the holder: it has stopped what it moved."""
        if session == self._holder:
            self.free()

    def free(self) -> None:
        """End the lease at once."""
        self._until = float("-inf")
