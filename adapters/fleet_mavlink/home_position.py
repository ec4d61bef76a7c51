"""Home position of a vehicle: its altitude, the reference of heights, and its change."""

from __future__ import annotations

import math

from fleet import GeoOrigin, GeoPoint, NotReady, Refused, TimedOut, world_from_geo
from fleet_mavlink.commander import Commander
from fleet_mavlink.constants import MavCmd, MavFrame
from fleet_mavlink.messages import CommandInt
from fleet_mavlink.preconditions import home_unknown, require_connection
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_KNOWN_WITHIN = 3.0  # s
_HOME_WITHIN = 4.0  # s; HOME_POSITION is sent once a second
_DEEPEST, _HIGHEST = -500.0, 9000.0  # m AMSL, plausible altitudes of a take-off
_SAME_HOME = 2.0  # m


class VehicleHome:
    """Home of one vehicle."""

    def __init__(self, vehicle: Vehicle, commander: Commander) -> None:
        self._vehicle = vehicle
        self._commander = commander

    async def altitude(self) -> float:
        """Return the altitude of home, m AMSL, waiting a moment for it; raises NotReady."""
        altitude = self._vehicle.state.home_altitude
        if altitude is None:
            await self._vehicle.until(lambda state: state.home_altitude is not None, _KNOWN_WITHIN)
            altitude = self._vehicle.state.home_altitude
        if altitude is None:
            raise home_unknown()
        return altitude

    async def set_here(self) -> None:
        """Make the present position home; in the air at home's old altitude, so that heights stay valid."""
        require_connection(self._vehicle)
        state = self._vehicle.state
        here = state.position
        if here is None or not state.knows_where(self._vehicle.now()):
            raise NotReady("position is unknown")
        altitude = None if _may_fly(state) else here.altitude
        _require_place(here.latitude, here.longitude, altitude or 0.0)
        await self._send(here.latitude, here.longitude, altitude)

    async def set_to(self, latitude: float, longitude: float, altitude: float | None) -> None:
        """Make a position home, and wait until the vehicle reports it; m AMSL, None: home's present altitude.

        Raises Refused for an invalid position, and for another altitude in the air, because heights are
        relative to it.
        """
        require_connection(self._vehicle)
        _require_place(latitude, longitude, altitude or 0.0)
        if altitude is not None and _may_fly(self._vehicle.state):
            raise Refused("in the air home keeps its altitude", hint="leave the altitude out")
        await self._send(latitude, longitude, altitude)

    async def _send(self, latitude: float, longitude: float, altitude: float | None) -> None:
        """Send a home position, and wait until the vehicle reports it."""
        home = GeoPoint(latitude, longitude, await self.altitude() if altitude is None else altitude)

        def shown(state: VehicleState) -> bool:
            return state.home is not None and _are_one(state.home, home)

        await self._commander.request(
            CommandInt(
                MavCmd.DO_SET_HOME,
                frame=MavFrame.GLOBAL,
                x=round(latitude * 1e7),
                y=round(longitude * 1e7),
                z=home.altitude,
            )
        )
        if not await self._vehicle.until(shown, _HOME_WITHIN):
            raise TimedOut("it accepted the command but reports another home position")


def _require_place(latitude: float, longitude: float, altitude: float) -> None:
    """Raise Refused unless this is a plausible home (degrees, m AMSL)."""
    if not (-90 < latitude < 90 and -180 <= longitude <= 180 and math.isfinite(altitude)):
        raise Refused("home must be a place on Earth, in degrees and metres")
    if not _DEEPEST <= altitude <= _HIGHEST:
        raise Refused(f"{altitude:g} m above mean sea level is no altitude of a home")


def _are_one(one: GeoPoint, other: GeoPoint) -> bool:
    """Return True if two positions are the same, within the resolution of the wire."""
    away = world_from_geo(GeoOrigin(one.latitude, one.longitude, one.altitude), other)
    return away.norm() <= _SAME_HOME


def _may_fly(state: VehicleState) -> bool:
    """Return True in the air, and while an armed aircraft has not said whether it flies."""
    if state.on_the_surface:
        return False
    return state.armed if state.in_air is None else state.in_air
