"""Home of a simulated vehicle: the reference of its heights, and where RTL leads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fleet_mavlink.sim.local_frame import Geo, Ned
from fleet_mavlink.sim.streams import home_position

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot


class SimHome:
    """Home of one vehicle; its ``place`` is None until it is known. The estimator's origin comes with it."""

    def __init__(self, pilot: Autopilot) -> None:
        self.place: Geo | None = None
        self._pilot = pilot

    @property
    def known(self) -> bool:
        """True once home is set, and with it the origin of the estimator."""
        return self.place is not None

    def ned(self) -> Ned:
        """Return home as a local position; where the vehicle was put down while home is unknown."""
        return self._pilot.frame.ned_of(*self.place) if self.place is not None else (0.0, 0.0, 0.0)

    def height(self) -> float:
        """Return the metres of the vehicle above home."""
        return self.ned()[2] - self._pilot.body.down

    def set_here(self) -> None:
        """Make the place of the vehicle its home, and send HOME_POSITION."""
        self.place = self._pilot.geo()
        self._pilot.out.append(home_position(self._pilot))
