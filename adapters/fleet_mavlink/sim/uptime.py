"""Time since the boot of a simulated autopilot."""

from __future__ import annotations

from collections.abc import Callable


class Uptime:
    """Time since boot, in seconds of the simulation; ``now`` returns the simulation's time.

    ``pace`` scales the time that the real autopilot takes to start. ``epoch`` is the Unix time at time 0.
    """

    def __init__(self, now: Callable[[], float], *, pace: float, epoch: float) -> None:
        self._now = now
        self._booted_at = now()
        self._pace = pace
        self._epoch = epoch

    def real_time(self, seconds: float) -> float:
        """Return the simulated time since boot of what the real autopilot does ``seconds`` after boot."""
        return seconds * self._pace

    def reached(self, real_seconds: float) -> bool:
        """Return True from the moment on that the real autopilot reaches ``real_seconds`` after boot."""
        return self._now() - self._booted_at >= self.real_time(real_seconds)

    @property
    def ms(self) -> int:
        """Milliseconds since boot, modulo 2**32."""
        return int((self._now() - self._booted_at) * 1000) & 0xFFFFFFFF

    @property
    def us(self) -> int:
        """Microseconds since boot."""
        return int((self._now() - self._booted_at) * 1e6)

    @property
    def unix(self) -> float:
        """Unix time of the simulation, s."""
        return self._epoch + self._now()
