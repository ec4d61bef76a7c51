"""Whether a board may be driven: heard, set up, its own dead-man confirmed; pure.

==========  =====================================  ==========================================
phase       what it means                          what leads on
==========  =====================================  ==========================================
silent      the line is open, nothing was heard    feedback: setup
setup       it was told how to behave              confirmed: ready; no answer: asked again,
                                                   after three times unguarded
ready       it may be driven
unguarded   its own stop is not sure               driven slowly
quiet       no feedback for a second               feedback: setup; three seconds: lost
==========  =====================================  ==========================================
"""

from __future__ import annotations

import enum

from fleet import Health, Level

QUIET_AFTER = 0.9  # s without feedback until the base counts as quiet
LOST_AFTER = 2.7  # s without feedback until the link counts as lost
ANSWER = 1.0  # s that the board has to confirm
TRIES = 3


class BoardPhase(enum.StrEnum):
    """Where a board stands."""

    SILENT = "silent"
    SETUP = "setup"
    READY = "ready"
    UNGUARDED = "unguarded"
    QUIET = "quiet"


HEALTH = {
    BoardPhase.SILENT: Health(Level.OFFLINE, "the line is open, the base has not spoken yet"),
    BoardPhase.SETUP: Health(Level.DEGRADED, "the base is being set up"),
    BoardPhase.READY: Health(),
    BoardPhase.UNGUARDED: Health(
        Level.DEGRADED, "the base did not confirm that it stops by itself; it is driven slowly"
    ),
    BoardPhase.QUIET: Health(Level.DEGRADED, "the base is silent; is its cable plugged in?"),
}
_WHY = {
    BoardPhase.SILENT: "the base has not spoken yet",
    BoardPhase.SETUP: "the base is being set up",
    BoardPhase.QUIET: "the base is silent",
}


class Readiness:
    """The phase of one opened line; ``confirms``: the board tells that it took its dead-man's time.

    ``guarded``: it has a dead-man at all. ``now`` is monotonic seconds.
    """

    def __init__(self, *, confirms: bool, guarded: bool, now: float) -> None:
        self.phase = BoardPhase.SILENT
        self._confirms = confirms
        self._guarded = guarded
        self._heard = now
        self._asked = now
        self._tries = 0

    @property
    def refusal(self) -> str:
        """Why it must not be driven, empty when it may."""
        return _WHY.get(self.phase, "")

    @property
    def unheard(self) -> bool:
        """True for a base that says nothing, or nothing any more."""
        return self.phase in {BoardPhase.SILENT, BoardPhase.QUIET}

    @property
    def health(self) -> Health:
        """How the way to the robot is."""
        return HEALTH[self.phase]

    def quiet_for(self, now: float) -> float:
        """Return the seconds since the last feedback."""
        return now - self._heard

    def opened(self, now: float) -> None:
        """Count the silence from now: the line is open, which takes time (a simulator starts first)."""
        self._heard = now

    def lost(self, now: float) -> bool:
        """Return True when the base was silent for too long."""
        return self.quiet_for(now) > LOST_AFTER

    def heard(self, now: float, *, restarted: bool) -> bool:
        """Take a feedback; True when the board is to be set up now."""
        self._heard = now
        if self.unheard or restarted:
            self._tries = 0
            self._ask(now)
            return True
        return False

    def confirmed(self) -> None:
        """Take the board's confirmation."""
        if self.phase in {BoardPhase.SETUP, BoardPhase.UNGUARDED}:
            self.phase = BoardPhase.READY if self._guarded else BoardPhase.UNGUARDED

    def look(self, now: float) -> bool:
        """Let time pass; True when the board is to be set up again."""
        if self.phase is not BoardPhase.SILENT and self.quiet_for(now) > QUIET_AFTER:
            self.phase = BoardPhase.QUIET
        if self.phase is not BoardPhase.SETUP or now - self._asked < ANSWER:
            return False
        if self._tries >= TRIES:
            self.phase = BoardPhase.UNGUARDED
            return False
        self._ask(now)
        return True

    def _ask(self, now: float) -> None:
        """Note that the board is set up now."""
        self.phase = BoardPhase.SETUP
        self._asked = now
        self._tries += 1
        if not self._confirms:
            self.confirmed()
