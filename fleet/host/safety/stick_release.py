"""A stop by somebody else ends a stream of velocities: who holds the stick lets go before he drives again.

Without it the next velocity, a twentieth of a second later, would undo the stop.
"""

from __future__ import annotations

MOST = 16  # drivers of one robot that are remembered; with a control lease there is one at a time


class StickReleaseInterlock:
    """Who drives one robot, and who of them was stopped by somebody else and has not let go since.

    A velocity of zero is letting go, and so are ``pause`` seconds without any. Times are monotonic. A zero
    that may be from before the stop is none of both: it is not told here.
    """

    def __init__(self, pause: float) -> None:
        self.pause = pause
        self._last: dict[str, float] = {}  # by driver, when his last velocity came, obeyed or not
        self._stopped: set[str] = set()

    def drove(self, driver: str, now: float) -> None:
        """Note a velocity that is obeyed, or is not because it is too late: he holds the stick."""
        self._last[driver] = now
        if len(self._last) > MOST:
            self._forget(now)

    def stopped(self, by: str, now: float) -> None:
        """Note a stop: everybody else who drives has to let go; who stops has done so himself."""
        self._forget(now)
        self._last.pop(by, None)
        self._stopped = set(self._last)

    def refusal(self, driver: str, now: float, *, zero: bool) -> str | None:
        """Return why this driver's velocity is not obeyed, None when it is."""
        if driver not in self._stopped:
            return None
        if zero or now - self._last[driver] >= self.pause:
            self._stopped.remove(driver)
            return None
        self._last[driver] = now
        pause = f"{self.pause:g} s without a velocity, or one of zero"
        return f"somebody else stopped it: let go ({pause}), then drive again"

    def _forget(self, now: float) -> None:
        """Forget who does not drive any more."""
        self._last = {each: at for each, at in self._last.items() if now - at < self.pause}
        self._stopped &= self._last.keys()
