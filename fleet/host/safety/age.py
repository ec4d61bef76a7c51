"""How old a message is when it arrives, though the sender's clock may be off.

Per session the smallest lag seen (arrival minus stamp) is the sender's clock offset plus the fastest way
here; what a message lags beyond that is its age. The offset is never believed beyond ``clock_skew``, so a
first message that is an hour old is refused, not taken for a clock that is an hour slow.
"""

from __future__ import annotations

import math
from collections import OrderedDict

SESSIONS = 256  # sessions remembered, oldest forgotten
WINDOW = 60.0  # s after which an estimate is made afresh, so that a corrected clock is followed


class _Session:
    """What is known of one sender's clock.

    ``offset`` is the smallest lag of this window and the one before, within ``skew``.
    """

    def __init__(self, now: float, skew: float) -> None:
        self.current = self.previous = self.offset = math.inf
        self.since = now
        self._skew = skew
        self.newest = float("-inf")
        self.stopped = float("-inf")

    def learn(self, lag: float, now: float) -> None:
        """Take the smallest lag of this window into account, or the first of the next."""
        if now - self.since > WINDOW:
            self.previous, self.since = self.current, now
        self.current = lag
        self.offset = max(-self._skew, min(self._skew, self.current, self.previous))


class AgeCheck:
    """The age rule of one robot; ``clock_skew`` in seconds."""

    def __init__(self, clock_skew: float) -> None:
        self._skew = clock_skew
        self._sessions: OrderedDict[str, _Session] = OrderedDict()

    def stopped(self, session: str, stamp: float, *, wall: float) -> None:
        """Note a stop of a session that is known: what it asked before may arrive later, by another way."""
        known = self._sessions.get(session)
        if known is not None:
            known.stopped = max(known.stopped, min(stamp, wall + self._skew))

    def refusal(
        self,
        session: str,
        stamp: float | None,
        *,
        wall: float,
        now: float,
        max_age: float,
        ordered: bool = False,
    ) -> str | None:
        """Return why a message is too old (or from the future), None when it is fresh.

        ``stamp`` and ``wall`` are Unix seconds, ``now`` monotonic. ``ordered``: also refuse one that is
        older than the newest that was let through (setpoints). One without a stamp is as old as its
        arrival.
        """
        if stamp is None:
            return None
        lag = wall - stamp
        if lag < -self._skew - max_age:
            return f"stamped {-lag:.1f} s in the future; check the sender's clock"
        known = self._session(session, lag, now)
        age = lag - known.offset
        if age > max_age or lag > self._skew + max_age:
            return f"{max(age, lag - self._skew):.1f} s old; the limit is {max_age:g} s"
        if stamp < known.stopped:
            return "asked before a stop that came before it"
        if stamp >= known.newest:
            known.newest = stamp
        elif ordered:
            return "older than a setpoint that came before it"
        return None

    def _session(self, session: str, lag: float, now: float) -> _Session:
        """Return the sender's record, with this lag learned."""
        known = self._sessions.get(session)
        if known is None:
            known = self._sessions[session] = _Session(now, self._skew)
            if len(self._sessions) > SESSIONS:
                self._sessions.popitem(last=False)
        self._sessions.move_to_end(session)
        if lag < known.current or now - known.since > WINDOW:
            known.learn(lag, now)
        return known
