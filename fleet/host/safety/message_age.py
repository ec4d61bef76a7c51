"""How old a message is when it arrives, though the sender's clock may be off.

Per session the smallest lag seen (arrival minus stamp) is the sender's clock offset plus the fastest way
here; what a message lags beyond that is its age. The offset is never believed beyond ``clock_skew``, so a
first message that is an hour old is refused, not taken for a clock that is an hour slow. A stream of
velocities whose every message lags more is refused: a slow clock and a slow way look alike.

Nothing from before a stop moves the robot after it. Within the stopper's own session the stamps decide, be
the stop the first that is heard of it. Others' clocks may be off by ``clock_skew``: what may be from before
by that much is refused.

A velocity of zero is judged like any other; what is refused of it here still ends motion (``Admission``).
"""

from __future__ import annotations

import itertools
import math
from collections import OrderedDict

import msgspec

SESSIONS = 256  # sessions remembered, oldest forgotten
WINDOW = 60.0  # s after which an estimate is made afresh, so that a corrected clock is followed
SHOWN = 8  # senders whose offset is shown, those heard last


class _Stop(msgspec.Struct, frozen=True):
    """A stop: its stamp, when it came (``wall`` Unix, ``at`` monotonic), and who sent it.

    ``shared``: who sent it gives no session, so several may stand behind that, each with a clock of his own.
    """

    stamp: float = -math.inf
    wall: float = -math.inf
    at: float = -math.inf
    by: str = ""
    shared: bool = False


class _Session:
    """What is known of one sender's clock.

    ``offset`` is the smallest lag of this window and the one before, within ``skew``.
    """

    def __init__(self, now: float, skew: float) -> None:
        self.current = self.previous = self.offset = math.inf
        self.since = now
        self._skew = skew
        self.newest = -math.inf
        self.stop = _Stop()

    @property
    def smallest(self) -> float:
        """The smallest lag of this window and the one before, as it was measured, s."""
        return min(self.current, self.previous)

    def learn(self, lag: float, now: float) -> None:
        """Take the smallest lag of this window into account, or the first of the next."""
        if now - self.since > WINDOW:
            self.previous, self.since = self.current, now
        self.current = lag
        self.offset = max(-self._skew, min(self._skew, self.smallest))

    def follow(self, stamp: float, ordered: bool) -> str | None:  # noqa: FBT001 - by position
        """Return that a setpoint was overtaken by another; note the newest."""
        if stamp >= self.newest:
            self.newest = stamp
            return None
        return "older than a setpoint that came before it" if ordered else None


class AgeCheck:
    """The age rule of one robot; ``clock_skew`` in seconds."""

    def __init__(self, clock_skew: float) -> None:
        self._skew = clock_skew
        self._sessions: OrderedDict[str, _Session] = OrderedDict()
        self._last_stop = _Stop()

    def stopped(
        self, session: str, stamp: float | None, *, wall: float, now: float, shared: bool = False
    ) -> None:
        """Note a stop: what was asked before it may arrive later, by whomever and whichever way.

        ``stamp`` is None where the stop has none. ``shared``: several may stand behind the session; their
        stamps decide of commands, but not of velocities, of which the next comes soon.
        """
        self._last_stop = _Stop(wall=wall, at=now)
        if stamp is not None:
            known = self._session(session, now)
            latest = max(known.stop.stamp, min(stamp, wall + self._skew))
            known.stop = self._last_stop = _Stop(latest, wall, now, session, shared)

    def offsets(self) -> dict[str, float]:
        """Return the smallest lag of each sender heard lately: its clock's offset and its way, s."""
        latest = itertools.islice(reversed(self._sessions.items()), SHOWN)
        return {name: round(known.smallest, 3) for name, known in latest if math.isfinite(known.smallest)}

    def refusal(
        self,
        session: str,
        stamp: float | None,
        *,
        wall: float,
        now: float,
        max_age: float,
        ordered: bool = False,
        moves: bool = True,
    ) -> str | None:
        """Return why a message is too old (or from the future), None when it is fresh.

        ``stamp`` and ``wall`` are Unix seconds, ``now`` monotonic. ``ordered``: it is one of a stream, of
        which nothing overtaken is obeyed, and nothing that always lags. ``moves``: it is refused after a
        stop by anybody, if it may be from before. One without a stamp is as old as its arrival.
        """
        if stamp is None:
            return None
        lag = wall - stamp
        if lag < -self._skew - (0.0 if ordered else max_age):
            return f"stamped {-lag:.2f} s in the future; {self._advice()}"
        known = self._session(session, now)
        if lag < known.current or now - known.since > WINDOW:
            known.learn(lag, now)
        late = self._late(known, lag, max_age, ordered=ordered)
        # Later than that none from before a stop is young enough, and clocks that were set do not matter.
        since = now - 2 * self._skew - max_age
        overtaken = self._overtaken(session, stamp, since, ordered=ordered, moves=moves)
        return late or overtaken or known.follow(stamp, ordered)

    def _late(self, known: _Session, lag: float, max_age: float, *, ordered: bool) -> str | None:
        """Return why a message that lags so much is too late."""
        if ordered and known.smallest > self._skew:
            return f"its sender's clock, or its way, is {known.smallest:.2f} s late; {self._advice()}"
        age = max(lag - known.offset, lag - self._skew)
        return f"{age:.1f} s old; the limit is {max_age:g} s" if age > max_age else None

    def _overtaken(
        self, session: str, stamp: float, since: float, *, ordered: bool, moves: bool
    ) -> str | None:
        """Return that a message is, or may be, from before a stop that came after ``since``."""
        own, last = self._sessions[session].stop, self._last_stop
        if stamp < own.stamp and own.at >= since and (moves or not own.shared):
            return "asked before a stop that came before it"
        decided = last.by == session and not (last.shared and ordered)
        if moves and not decided and last.at >= since and stamp - self._skew < last.wall:
            return "asked before somebody's stop, or so soon after it that nobody can tell"
        return None

    def _advice(self) -> str:
        """Say what is allowed, and what to do."""
        return f"clock_skew is {self._skew:g} s: set the clock, or allow more in fleet.yaml"

    def _session(self, session: str, now: float) -> _Session:
        """Return the sender's record."""
        known = self._sessions.get(session)
        if known is None:
            known = self._sessions[session] = _Session(now, self._skew)
            if len(self._sessions) > SESSIONS:
                self._sessions.popitem(last=False)
        self._sessions.move_to_end(session)
        return known
