"""Motors as joints of the twin: their speeds, and the angles integrated from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fleet import JointReport
from fleet_mavlink.onboard_sensors import OnboardSensors

_FRESH = 3.0  # s for which a speed is valid


class Motors:
    """The joints by name, in the autopilot's order of motors; angles are integrated from the speeds."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._angles = [0.0] * len(self._names)
        self._at: float | None = None

    def report(self, sensors: OnboardSensors, now: float, stamp: float) -> JointReport | None:
        """Return the joints at monotonic ``now``; None without names, or without recent speeds."""
        if not self._names or now - sensors.motors_at > _FRESH:
            self._at = None
            return None
        since = 0.0 if self._at is None else now - self._at
        self._at = now
        speeds = sensors.motors[: len(self._names)]
        for place, speed in enumerate(speeds):
            self._angles[place] = (self._angles[place] + speed * since) % math.tau
        named = self._names[: len(speeds)]
        return JointReport(
            stamp,
            dict(zip(named, self._angles, strict=False)),
            dict(zip(named, speeds, strict=True)),
        )
