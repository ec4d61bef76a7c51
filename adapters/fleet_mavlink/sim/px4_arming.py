"""Arming checks of PX4."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.arming_checks import ArmingChecks

if TYPE_CHECKING:
    from fleet_mavlink.sim.px4 import SimPx4


class Px4Arming(ArmingChecks):
    """Arming checks of one PX4."""

    def __init__(self, pilot: SimPx4) -> None:
        self._pilot = pilot

    def refusals(self, *, force: bool) -> list[str]:
        """Return why the motors cannot be armed; force skips all checks but those of the start."""
        pilot = self._pilot
        started = pilot.uptime.reached(pilot.gps.profile.usable_after)
        if not started or "not_ready" in pilot.faults or pilot.terminated:
            return ["Resolve system health failures first"]
        if force:
            return []
        found = []
        if not pilot.has_position or pilot.refusal_of(pilot.mode) or not pilot.mode.armable:
            found.append("Resolve system health failures first")
        if pilot.params["NAV_DLL_ACT"] > 0 and pilot.gcs_lost:
            found.append("No connection to the ground control station")
        return found
