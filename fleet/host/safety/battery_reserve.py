"""Battery reserve: refuses goals that would use it up and detects a low battery. Pure."""

from __future__ import annotations

import msgspec

CHARGED = 5.0  # percent above ``low`` at which a battery counts as charged again: hysteresis against noise


class BatteryReserve(msgspec.Struct, frozen=True):
    """Thresholds in percent: ``keep`` must be left after the return home, at ``low`` the policy acts.

    ``endurance`` is the motion time of a full battery in seconds, None when unknown.
    """

    keep: float
    low: float
    endurance: float | None = None

    def trouble(self, percent: float | None, metres: float = 0.0, speed: float | None = None) -> str:
        """Return why a path of ``metres``, there and home, must not be started; empty when it may."""
        if percent is None:
            return "its battery level is unknown"
        needed = 0.0
        if self.endurance is not None and speed:
            needed = 100 * metres / speed / self.endurance
        if percent - needed >= self.keep:
            return ""
        what = f", the way there and home takes {needed:.0f} %" if needed >= 1 else ""
        return f"the battery is at {percent:.0f} %{what} and {self.keep:g} % must be left"

    def start_trouble(self, percent: float | None) -> str:
        """Return why a take-off is refused, empty when not. At ``low`` the policy would act at once."""
        if self.is_low(percent):
            needed = max(self.low, self.keep)
            return f"the battery is at {percent:.0f} %, a take-off needs more than {needed:g} %"
        return self.trouble(percent)

    def is_low(self, percent: float | None) -> bool:
        """Return whether the policy must act now."""
        return percent is not None and percent <= self.low

    def is_charged(self, percent: float) -> bool:
        """Return whether the charge is so far above ``low`` that the next low level is a new one."""
        return percent >= self.low + CHARGED
