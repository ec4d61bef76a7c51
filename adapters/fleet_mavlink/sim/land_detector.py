"""Land detector of a simulated autopilot: take-off and touch-down as it reports them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import LANDING, ON_GROUND

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot


class LandDetector:
    """Land detector of one vehicle.

    ``left_ground``: it has left the ground since it was armed; ``touched_at``: when it touched down, s, None
    until it has.
    """

    def __init__(self, pilot: Autopilot) -> None:
        self.left_ground = False
        self.touched_at: float | None = None
        self._pilot = pilot

    @property
    def landed(self) -> bool:
        """True while the vehicle counts as being on the ground."""
        return self._pilot.body.grounded

    def state(self) -> int:
        """Return MAV_LANDED_STATE."""
        if self.landed:
            return ON_GROUND
        return self._pilot.manoeuvre.in_air_state if self._pilot.armed else LANDING

    def arm(self) -> None:
        """Start anew: the motors were started."""
        self.left_ground = False
        self.touched_at = None

    def watch(self) -> None:
        """Note a take-off and a touch-down."""
        if not self.landed:
            self.left_ground = self.left_ground or self._pilot.armed
            self.touched_at = None
        elif self.left_ground and self.touched_at is None:
            self.touched_at = self._pilot.time
            self.touch_down()

    def touch_down(self) -> None:
        """Send the text of a touch-down, if there is one."""
