"""Readiness of a board to be driven: it sends, is set up, its own dead-man is confirmed; pure.

==========  =====================================  ==========================================
phase       meaning                                next
==========  =====================================  ==========================================
silent      the line is open, nothing was heard    feedback: setup
setup       its settings were written              confirmed: ready; no answer: again,
                                                   after three times: unguarded
ready       it may be driven
unguarded   its own dead-man is not confirmed      it is driven slowly
quiet       no feedback for a second               feedback: setup; three seconds: lost
==========  =====================================  ==========================================
"""

from __future__ import annotations

import enum

from fleet import Health, Level

QUIET_AFTER = 0.9  # s without feedback until the base counts as quiet
LOST_AFTER = 2.7  # s without feedback until the link counts as lost
ANSWER = 1.0  # s within which the board must confirm
TRIES = 3


class BoardPhase(enum.StrEnum):
    """Phase of a board."""

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
    """State machine of one opened line; ``confirms``: the board confirms its dead-man's time.

    ``guarded``: it has a dead-man at all. ``now`` is monotonic seconds.
    """

    def __init__(self, *, confirms: bool, guarded: bool, now: float) -> None:
        self.phase = BoardPhase.SILENT
        self._confirms = confirms
        self._guarded = guarded
        self._heard = now
        self._requested = now
        self._tries = 0

    @property
    def refusal(self) -> str:
        """Why the board must not be driven; empty when it may."""
        return _WHY.get(self.phase, "")

    @property
    def is_silent(self) -> bool:
        """True for a base that is silent, or has become so."""
        return self.phase in {BoardPhase.SILENT, BoardPhase.QUIET}

    @property
    def health(self) -> Health:
        """Health of the link to the robot."""
        return HEALTH[self.phase]

    def quiet_for(self, now: float) -> float:
        """Return the seconds since the last feedback."""
        return now - self._heard

    def opened(self, now: float) -> None:
        """Measure silence from now on: opening takes time (a simulator starts first)."""
        self._heard = now

    def lost(self, now: float) -> bool:
        """Return True when the base was silent for too long."""
        return self.quiet_for(now) > LOST_AFTER

    def record_feedback(self, now: float, *, restarted: bool) -> bool:
        """Note a feedback; return True when the board must be set up now."""
        self._heard = now
        if self.is_silent or restarted:
            self._tries = 0
            self._request(now)
            return True
        return False

    def confirmed(self) -> None:
        """Note the board's confirmation."""
        if self.phase in {BoardPhase.SETUP, BoardPhase.UNGUARDED}:
            self.phase = BoardPhase.READY if self._guarded else BoardPhase.UNGUARDED

    def check(self, now: float) -> bool:
        """Check the time-outs; return True when the board must be set up again."""
        if self.phase is not BoardPhase.SILENT and self.quiet_for(now) > QUIET_AFTER:
            self.phase = BoardPhase.QUIET
        if self.phase is not BoardPhase.SETUP or now - self._requested < ANSWER:
            return False
        if self._tries >= TRIES:
            self.phase = BoardPhase.UNGUARDED
            return False
        self._request(now)
        return True

    def _request(self, now: float) -> None:
        """Note that the settings are written now."""
        self.phase = BoardPhase.SETUP
        self._requested = now
        self._tries += 1
        if not self._confirms:
            self.confirmed()
