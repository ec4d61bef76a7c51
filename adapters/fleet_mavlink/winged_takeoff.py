"""Take-off of a plane: along its runway, until it circles at the height."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator

from fleet import GeoPoint, NotReady, Progress, TimedOut
from fleet_mavlink.constants import Landed
from fleet_mavlink.flight import Flight, height_of
from fleet_mavlink.preconditions import known_position
from fleet_mavlink.state import VehicleState
from fleet_mavlink.wings import HEIGHT, Winged

_POLL = 0.5  # s between checks
_OFF_GROUND_WITHIN = 30.0  # s
_CLOSE = 3.0  # m below its height at which ArduPlane's TAKEOFF levels off


class WingedTakeOff:
    """One take-off. PX4 starts to circle on its own; ArduPlane is commanded to."""

    def __init__(self, flight: Flight, flavour: Winged, altitude: float) -> None:
        self._flight = flight
        self._vehicle = flight.vehicle
        self._flavour = flavour
        self._altitude = altitude
        self._speed = flavour.airspeed(self._vehicle.state, flight.fastest, None)
        self._own = self._own_height()

    def _own_height(self) -> float:
        """Return the height at which the autopilot's own take-off ends, m above home."""
        name = self._flavour.takeoff_height
        if name is None:
            return self._altitude
        own = self._vehicle.state.settings.get(name)
        if own is None:
            raise NotReady(
                f"{name} is not known yet", hint="it is read after the vehicle connects; try again"
            )
        return min(own, self._altitude)

    async def climb(self) -> AsyncIterator[Progress]:
        """Arm if necessary, and take off; raises the refusal, Fault if its motor stopped, TimedOut."""
        flight, flavour, vehicle = self._flight, self._flavour, self._vehicle
        flight.end_stream(flavour, flavour.takeoff)
        if not vehicle.state.in_air:
            arms = not vehicle.state.armed
            await flight.arming.arm()
            home = await flight.home.altitude()
            await flight.enter(flavour.takeoff, flavour.takeoff_command(self._altitude, home))
            yield Progress(0.0, "taking off")
            async for progress in self._leave_ground(disarms=arms):
                yield progress
        async for progress in self._circle():
            yield progress
        yield Progress(100.0, f"it circles at {height_of(vehicle.state):.1f} m")

    async def _leave_ground(self, *, disarms: bool) -> AsyncIterator[Progress]:
        """Follow it to the end of the autopilot's own take-off."""
        flight, flavour, vehicle = self._flight, self._flavour, self._vehicle
        by = vehicle.now() + _OFF_GROUND_WITHIN
        while not await vehicle.until(self._is_up, _POLL):
            flight.check(flavour.takeoff, flavour.hold)
            if vehicle.now() > by and height_of(vehicle.state) < 1.0:
                if disarms:
                    await flight.arming.disarm_quietly()
                raise TimedOut(f"it did not leave the ground in {_OFF_GROUND_WITHIN:g} s")
            yield self._progress()

    def _is_up(self, state: VehicleState) -> bool:
        """Return True once the autopilot's own take-off is over, or as high as it gets."""
        if self._flavour.takeoff_height is not None:
            return bool(state.in_air) and height_of(state) >= self._own - _CLOSE
        return self._flight.mode(state) == self._flavour.hold and state.landed is Landed.IN_AIR

    async def _circle(self) -> AsyncIterator[Progress]:
        """Let it climb to its height in a circle at this position."""
        flight, vehicle = self._flight, self._vehicle
        if self._flavour.takeoff_height is None and self._at_height(vehicle.state):
            return
        here, home = known_position(vehicle), await flight.home.altitude()
        await flight.go(GeoPoint(here.latitude, here.longitude, home + self._altitude), self._speed, math.nan)
        while not await vehicle.until(self._at_height, _POLL):
            flight.check(self._flavour.goto)
            yield self._progress()

    def _at_height(self, state: VehicleState) -> bool:
        """Return True if it is at its height."""
        return abs(height_of(state) - self._altitude) <= HEIGHT

    def _progress(self) -> Progress:
        """Return the progress of its climb."""
        height = height_of(self._vehicle.state)
        percent = max(0.0, min(99.0, 100 * height / self._altitude))
        return Progress(percent, f"at {height:.1f} m of {self._altitude:g} m")
