"""Who has the robot: the last one to move it keeps it for a while, so that two cannot fight over it.

Stops pass from anyone. Teleoperation takes the robot from navigation; nothing takes it from a person but
time. A run of a mission has its robots until it ends, or until somebody takes one out of it.
"""

from __future__ import annotations

from fleet.model.command import RUN_SESSION, session_of


class ControlLease:
    """One robot's lease; ``seconds`` after the holder's last motion it is free.

    ``run`` is the run of a mission that has it, empty when none has; ``left`` why the last one has it no
    more.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._holder = ""
        self._until = float("-inf")
        self.run = ""
        self.left = ""

    def refusal(self, session: str, now: float) -> str | None:
        """Return why this session may not move the robot now, None when it may."""
        if self.run:
            if session == session_of(self.run):
                return None
            return f"it is in run {self.run}; fleet take takes it out of the run"
        if session.startswith(RUN_SESSION):
            return f"it has left the run: {self.left or 'it never joined'}"
        if now >= self._until or session == self._holder:
            return None
        return f"{self._holder or 'another operator'} has control for {self._until - now:.1f} s more"

    def holder(self, now: float) -> str:
        """Return the session that has the robot now, empty when none has; a run of a mission is ``run``."""
        return self._holder if now < self._until and not self.run else ""

    def control(self, now: float) -> str:
        """Return who has control now, in words; empty while nobody has."""
        return f"{self._holder or 'an operator'} has control" if now < self._until else ""

    def take(self, session: str, now: float) -> None:
        """Give the robot to this session from now on."""
        self._holder = session
        self._until = now + self.seconds

    def join(self, run: str, now: float) -> str | None:
        """Give the robot to a run of a mission until it leaves; return why not, None when it is given."""
        if self.run and self.run != run:
            return f"it is in run {self.run}"
        if not self.run and now < self._until:
            return f"{self._holder or 'another operator'} has control for {self._until - now:.1f} s more"
        self.run, self.left = run, ""
        return None

    def leave(self, why: str) -> None:
        """Take the robot out of the run that has it, if one has."""
        if self.run:
            self.run, self.left = "", why

    def others_moved(self, session: str, why: str) -> None:
        """Take the robot out of its run when somebody else moves or stops it."""
        if self.run and session != session_of(self.run):
            self.leave(why)

    def let_go(self, session: str) -> None:
        """End the lease of this session, if it is the holder: it has stopped what it moved."""
        if session == self._holder:
            self._until = float("-inf")

    def free(self, why: str) -> None:
        """End the lease at once, and take the robot out of its run."""
        self._until = float("-inf")
        self.leave(why)
