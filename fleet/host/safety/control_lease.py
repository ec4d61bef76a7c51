"""Control lease: the last sender to move a robot keeps it for a while, so that two cannot fight over it.

Stops pass from any sender. Teleoperation takes the robot from navigation; only time takes it from a person.
A mission run keeps its robots until it ends, or until a person takes one out of it.
"""

from __future__ import annotations

from fleet.model.command import RUN_SESSION, session_of


class ControlLease:
    """Control lease of one robot; it expires ``seconds`` after the holder's last motion.

    ``run`` is the mission run that has the robot, empty when none has; ``left`` is why the last run lost it.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._holder = ""
        self._until = float("-inf")
        self.run = ""
        self.left = ""

    def refusal(self, session: str, now: float) -> str | None:
        """Return why this session may not move the robot now; None when it may."""
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
        """Return the session that holds the lease, empty when none does; for a mission run see ``run``."""
        return self._holder if now < self._until and not self.run else ""

    def control(self, now: float) -> str:
        """Return the holder of the lease as text for people; empty when it is free."""
        return f"{self._holder or 'an operator'} has control" if now < self._until else ""

    def acquire(self, session: str, now: float) -> None:
        """Start or renew the lease of this session."""
        self._holder = session
        self._until = now + self.seconds

    def join(self, run: str, now: float) -> str | None:
        """Give the robot to a mission run until it leaves; return the refusal, None when it was given."""
        if self.run and self.run != run:
            return f"it is in run {self.run}"
        if not self.run and now < self._until:
            return f"{self._holder or 'another operator'} has control for {self._until - now:.1f} s more"
        self.run, self.left = run, ""
        return None

    def leave(self, why: str) -> None:
        """Take the robot out of its run, if it is in one."""
        if self.run:
            self.run, self.left = "", why

    def others_moved(self, session: str, why: str) -> None:
        """Take the robot out of its run when another sender moves or stops it."""
        if self.run and session != session_of(self.run):
            self.leave(why)

    def release(self, session: str) -> None:
        """End this session's lease, if it is the holder: it has stopped the robot."""
        if session == self._holder:
            self._until = float("-inf")

    def free(self, why: str) -> None:
        """End the lease at once and take the robot out of its run."""
        self._until = float("-inf")
        self.leave(why)
