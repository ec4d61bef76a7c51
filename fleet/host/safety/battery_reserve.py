"""What must be left in the battery: goals beyond it are refused, and a low one is acted upon. Pure."""

from __future__ import annotations

import msgspec

CHARGED = 5.0  # percent above ``low`` from which a battery counts as charged again: a reading wavers


class BatteryReserve(msgspec.Struct, frozen=True):
    """Percent: ``keep`` must be left when the robot is back home, at ``low`` it is acted upon.

    ``endurance`` is how many seconds a full battery moves the robot, None when nobody knows.
    """

    keep: float
    low: float
    endurance: float | None = None

    def trouble(self, percent: float | None, metres: float = 0.0, speed: float | None = None) -> str:
        """Return why a way of ``metres``, there and home, may not be begun; empty when it may."""
        if percent is None:
            return "how full the battery is is unknown"
        needed = 0.0
        if self.endurance is not None and speed:
            needed = 100 * metres / speed / self.endurance
        if percent - needed >= self.keep:
            return ""
        what = f", the way there and home takes {needed:.0f} %" if needed >= 1 else ""
        return f"the battery is at {percent:.0f} %{what} and {self.keep:g} % must be left"

    def start_trouble(self, percent: float | None) -> str:
        """Return why a flight may not be begun; empty when it may: what is low is acted upon at once."""
        if self.is_low(percent):
            needed = max(self.low, self.keep)
            return f"the battery is at {percent:.0f} %, a take-off needs more than {needed:g} %"
        return self.trouble(percent)

    def is_low(self, percent: float | None) -> bool:
        """Return whether it must be acted upon now."""
        return percent is not None and percent <= self.low

    def is_charged(self, percent: float) -> bool:
        """Return whether it is so far above low that the next time it is low is another one."""
        return percent >= self.low + CHARGED
