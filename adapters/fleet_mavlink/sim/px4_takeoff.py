"""PX4's take-off: reported before the vehicle lifts off, and ended below its height; its land detector."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fleet_mavlink.sim.land_detector import LandDetector
from fleet_mavlink.sim.manoeuvres import IN_AIR, GoToManoeuvre, Manoeuvre, Takeoff
from fleet_mavlink.sim.message_output import INFO

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


class Px4TakeoffControl:
    """Take-off of one PX4: requested, begun once the motors are armed, ended by LOITER below its height."""

    def __init__(self, pilot: SimPx4) -> None:
        self._pilot = pilot
        self._requested: Manoeuvre | None = None

    def request(self, manoeuvre: Manoeuvre) -> None:
        """Start a take-off now, or once the motors are armed."""
        pilot = self._pilot
        pilot.failsafes.over()
        self._requested = manoeuvre
        pilot.enter(pilot.modes["TAKEOFF"])
        if pilot.armed:
            self.begin()

    def begin(self) -> None:
        """Start the requested take-off; its delay counts from now."""
        requested, self._requested = self._requested, None
        if requested is not None:
            self._fly(requested)

    def _fly(self, requested: Manoeuvre) -> None:
        """Start a take-off, or the manoeuvre that was requested in its place."""
        pilot = self._pilot
        pilot.manoeuvre = (
            Px4Takeoff(pilot, requested.altitude) if isinstance(requested, Px4Takeoff) else requested
        )

    def watch(self) -> None:
        """Detect a take-off, which sets home again, and end it NAV_MC_ALT_RAD below its height."""
        pilot = self._pilot
        flown = pilot.manoeuvre
        if not isinstance(flown, Px4Takeoff):
            return
        if not flown.detected and pilot.time >= flown.detected_at:
            flown.detected = True
            pilot.say(INFO, "Takeoff detected")
            pilot.home.set_here()
            flown.down = pilot.frame.down_of(flown.altitude)
        if pilot.flying and pilot.body.down - flown.down <= pilot.params["NAV_MC_ALT_RAD"]:
            pilot.enter(pilot.modes["LOITER"])
            pilot.manoeuvre = GoToManoeuvre(flown.north, flown.east, flown.down, heading=flown.heading)


class Px4LandDetector(LandDetector):
    """Land detector of one PX4 multirotor."""

    @property
    def landed(self) -> bool:
        """True on the ground until a take-off is detected."""
        flown = self._pilot.manoeuvre
        return self._pilot.body.grounded and not (isinstance(flown, Px4Takeoff) and flown.detected)

    def touch_down(self) -> None:
        """Send the text of a landing."""
        self._pilot.say(INFO, "Landing detected")


def wander(amplitude: float, now: float) -> float:
    """Return the error of the estimated height of a vehicle on the ground, m."""
    return amplitude * math.sin(_WANDERS * now)
