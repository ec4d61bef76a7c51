"""Camera mount of a simulated board: two servos that turn at the commanded speed; pure."""

from __future__ import annotations

DEGREES_A_STEP = 360.0 / 4096
LOW, HIGH = (-180.0, -30.0), (180.0, 90.0)  # of pan and tilt, degrees


class Mount:
    """Two servos; ``at``: current angles (pan, tilt), degrees."""

    def __init__(self) -> None:
        self.at = (0.0, 0.0)
        self._target = (0.0, 0.0)
        self._speeds = (0.0, 0.0)  # degrees a second
        self._now = 0.0

    def send(self, pan: float, tilt: float, pan_steps: float, tilt_steps: float) -> None:
        """Go there at so many steps a second, in whole degrees, as the firmware does."""
        wanted = (float(int(pan)), float(int(tilt)))
        bounded = [min(max(each, low), high) for each, low, high in zip(wanted, LOW, HIGH, strict=True)]
        self._target = (bounded[0], bounded[1])
        self._speeds = (pan_steps * DEGREES_A_STEP, tilt_steps * DEGREES_A_STEP)

    def stop(self) -> None:
        """Stop at the current angles."""
        self._target = self.at

    def turn(self, now: float) -> None:
        """Advance the time to ``now`` (s)."""
        seconds, self._now = max(0.0, now - self._now), now
        steps = [speed * seconds for speed in self._speeds]
        moved = [
            at + max(-step, min(step, target - at))
            for at, target, step in zip(self.at, self._target, steps, strict=True)
        ]
        self.at = (moved[0], moved[1])
