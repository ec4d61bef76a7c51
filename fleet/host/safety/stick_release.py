"""Stick-release interlock: after another sender's stop, a driver releases the stick before driving again.

Without it the next velocity of the stream, 50 ms later, would undo the stop.
"""

from __future__ import annotations

MOST = 16  # drivers remembered for one robot; a control lease allows one at a time


class StickReleaseInterlock:
    """Drivers of one robot, and those that must release the stick after another sender's stop.

    A zero velocity releases the stick, and so do ``pause`` seconds without a velocity. Times are monotonic. A
    zero that may be from before the stop is neither: the caller does not report it.
    """

    def __init__(self, pause: float) -> None:
        self.pause = pause
        self._last: dict[str, float] = {}  # by driver: arrival of the last velocity, obeyed or not
        self._stopped: set[str] = set()

    def record_velocity(self, driver: str, now: float) -> None:
        """Record a velocity that was obeyed or refused for its age: in both cases the stick is held."""
        self._last[driver] = now
        if len(self._last) > MOST:
            self._forget(now)

    def stopped(self, by: str, now: float) -> None:
        """Record a stop: all other drivers must release the stick; the sender of the stop has done so."""
        self._forget(now)
        self._last.pop(by, None)
        self._stopped = set(self._last)

    def refusal(self, driver: str, now: float, *, zero: bool) -> str | None:
        """Return why this driver's velocity is not obeyed; None when it is."""
        if driver not in self._stopped:
            return None
        if zero or now - self._last[driver] >= self.pause:
            self._stopped.remove(driver)
            return None
        self._last[driver] = now
        pause = f"{self.pause:g} s without a velocity, or a zero velocity"
        return f"another sender stopped it: release the stick ({pause}), then drive again"

    def _forget(self, now: float) -> None:
        """Remove drivers that no longer drive."""
        self._last = {each: at for each, at in self._last.items() if now - at < self.pause}
        self._stopped &= self._last.keys()
