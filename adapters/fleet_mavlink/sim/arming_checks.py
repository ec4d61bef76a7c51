"""Arming checks of a simulated autopilot: what each autopilot brings."""

from __future__ import annotations

from abc import ABC, abstractmethod


class ArmingChecks(ABC):
    """Arming checks of one vehicle."""

    @abstractmethod
    def refusals(self, *, force: bool) -> list[str]:
        """Return why the motors cannot be armed now, in the autopilot's words; empty if they can.

        ``force`` skips the checks that the autopilot skips then.
        """
