"""Age of a message at arrival, although the sender's clock may be off.

The smallest lag seen in a session (arrival minus stamp) is the offset of the sender's clock plus the shortest
transit time; a message's lag beyond it is its age. The offset is trusted only up to ``clock_skew``, so a
first message that is an hour old is refused instead of being taken for a clock that is an hour slow. A
velocity stream in which every message lags more is refused: a slow clock and a slow network look alike.

Nothing sent before a stop moves the robot after it. Within the session that sent the stop the stamps decide,
even if the stop is its first message. Other clocks may be off by ``clock_skew``: a message that may be from
before the stop by that much is refused.

A zero velocity is judged like any other; if it is refused here it still ends motion (``Admission``).
"""

from __future__ import annotations

import itertools
import math
from collections import OrderedDict

import msgspec

SESSIONS = 256  # sessions remembered, oldest forgotten
WINDOW = 60.0  # s until an estimate starts anew, so that it follows a corrected clock
SHOWN = 8  # senders whose offset is shown, the most recent ones


class _Stop(msgspec.Struct, frozen=True):
    """A stop: its stamp, its arrival (``wall`` Unix, ``at`` monotonic) and its sender ``by``.

    ``shared``: the sender gives no session, so it may stand for several, each with its own clock.
    """

    stamp: float = -math.inf
    wall: float = -math.inf
    at: float = -math.inf
    by: str = ""
    shared: bool = False


class _SenderClock:
    """Clock estimate and newest stop of one sender.

    ``smallest`` is the smallest lag of this window and the previous one as measured, s; ``offset`` is that
    within ``skew``.
    """

    def __init__(self, now: float, skew: float) -> None:
        self.current = self.previous = self.smallest = math.inf
        self.offset = skew
        self.since = now
        self._skew = skew
        self.newest = -math.inf
        self.stop = _Stop()

    def update_lag(self, lag: float, now: float) -> None:
        """Set the smallest lag of this window, or start the next window with it."""
        if now - self.since > WINDOW:
            self.previous, self.since = self.current, now
        self.current, self.smallest = lag, min(lag, self.previous)
        self.offset = max(-self._skew, min(self._skew, self.smallest))


class AgeCheck:
    """Age check of one robot; ``clock_skew`` in seconds."""

    def __init__(self, clock_skew: float) -> None:
        self._skew = clock_skew
        self._sessions: OrderedDict[str, _SenderClock] = OrderedDict()
        self._last_stop = _Stop()

    def stopped(
        self, session: str, stamp: float | None, *, wall: float, now: float, shared: bool = False
    ) -> None:
        """Record a stop: requests sent before it may arrive later, from any sender, over any transport.

        ``stamp`` is None where the stop has none. ``shared``: the session may stand for several senders.
        Their stamps decide for commands but not for velocities, since the next velocity follows soon.
        """
        self._last_stop = _Stop(wall=wall, at=now)
        if stamp is not None:
            known = self._session(session, now)
            latest = max(known.stop.stamp, min(stamp, wall + self._skew))
            known.stop = self._last_stop = _Stop(latest, wall, now, session, shared)

    def offsets(self) -> dict[str, float]:
        """Return the smallest lag of recent senders, s: offset of the clock plus transit time."""
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
        """Return why a message is too old (or from the future); None when it is fresh.

        ``stamp`` and ``wall`` are Unix seconds, ``now`` monotonic. ``ordered``: it belongs to a stream, in
        which a message that was overtaken is refused, and so is a sender that always lags. ``moves``: it is
        refused after any sender's stop if it may be from before it. A message without a stamp is as old as
        its arrival.
        """
        if stamp is None:
            return None
        lag = wall - stamp
        if lag < -self._skew - (0.0 if ordered else max_age):
            return f"stamped {-lag:.2f} s in the future; {self._advice()}"
        known = self._session(session, now)
        if lag < known.current or now - known.since > WINDOW:
            known.update_lag(lag, now)
        late = self._late(known, lag, max_age, ordered=ordered)
        # Beyond this time no message from before the stop is young enough, and changed clocks do not matter.
        since = now - 2 * self._skew - max_age
        overtaken = self._overtaken(session, stamp, since, ordered=ordered, moves=moves)
        if late is not None or overtaken is not None:
            return late or overtaken
        if stamp >= known.newest:
            known.newest = stamp
            return None
        return "older than a setpoint that arrived before it" if ordered else None

    def _late(self, known: _SenderClock, lag: float, max_age: float, *, ordered: bool) -> str | None:
        """Return why a message with this lag is too late; None when it is not."""
        if ordered and known.smallest > self._skew:
            behind = f"its sender's clock is {known.smallest:.2f} s behind, or the network delays it as much"
            return f"{behind}; {self._advice()}"
        age = lag - known.offset
        return f"{age:.1f} s old; the limit is {max_age:g} s" if age > max_age else None

    def _overtaken(
        self, session: str, stamp: float, since: float, *, ordered: bool, moves: bool
    ) -> str | None:
        """Return the refusal of a message that may be from before a stop that arrived after ``since``."""
        last = self._last_stop
        # The sender's own record may have been evicted since, by many other senders.
        own = last if last.by == session else self._sessions[session].stop
        if stamp < own.stamp and own.at >= since and (moves or not own.shared):
            return "sent before a stop that arrived first"
        decided = last.by == session and not (last.shared and ordered)
        if moves and not decided and last.at >= since and stamp - self._skew < last.wall:
            return "sent before another sender's stop, or too soon after it to be sure"
        return None

    def _advice(self) -> str:
        """Return the allowed skew and the cure, for a refusal."""
        return f"clock_skew is {self._skew:g} s: set the clock, or allow more in fleet.yaml"

    def _session(self, session: str, now: float) -> _SenderClock:
        """Return the sender's record; create it at its first message."""
        known = self._sessions.get(session)
        if known is None:
            known = self._sessions[session] = _SenderClock(now, self._skew)
            if len(self._sessions) > SESSIONS:
                self._sessions.popitem(last=False)
        self._sessions.move_to_end(session)
        return known
