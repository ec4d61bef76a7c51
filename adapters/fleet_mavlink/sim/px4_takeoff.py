"""PX4's take-off: reported before the vehicle lifts off, and ended below its height."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fleet_mavlink.sim.manoeuvres import IN_AIR, GoToManoeuvre, Takeoff

if TYPE_CHECKING:
    from fleet_mavlink.sim.autopilot import Autopilot
    from fleet_mavlink.sim.px4 import SimPx4

_DETECTED = 1.8  # s from arming to "Takeoff detected"
_DETECTED_RUNNING = 0.5  # s, if the motors have been running for a while
_LIFTS_RUNNING = 3.0  # s from then to lift-off
_WANDERS = 0.7  # rad/s: frequency of the height error of a vehicle on the ground


class Px4Takeoff(Takeoff):
    """Climb to ``altitude``, m AMSL as estimated by the vehicle; ``detected`` once it is reported."""

    def __init__(self, pilot: Autopilot, altitude: float) -> None:
        super().__init__(pilot, pilot.frame.down_of(altitude))
        self.altitude = altitude
        grounded = pilot.body.grounded
        running = pilot.armed and pilot.time - pilot.armed_at > pilot.spin_up
        self.detected = not grounded
        self.detected_at = pilot.time + (_DETECTED_RUNNING if running else _DETECTED)
        if grounded and running:
            self.lift_at = pilot.time + _LIFTS_RUNNING
        if not grounded:
            self.in_air_state = IN_AIR


def watch(pilot: SimPx4) -> None:
    """Detect a take-off, which sets home again, and end it NAV_MC_ALT_RAD below its height."""
    flown = pilot.manoeuvre
    if not isinstance(flown, Px4Takeoff):
        return
    if not flown.detected and pilot.time >= flown.detected_at:
        flown.detected = True
        pilot.takeoff_detected()
        flown.down = pilot.frame.down_of(flown.altitude)
    if pilot.flying and pilot.body.down - flown.down <= pilot.params["NAV_MC_ALT_RAD"]:
        pilot.takeoff_ended(GoToManoeuvre(flown.north, flown.east, flown.down, heading=flown.heading))


def wander(amplitude: float, now: float) -> float:
    """Return the error of the estimated height of a vehicle on the ground, m."""
    return amplitude * math.sin(_WANDERS * now)
