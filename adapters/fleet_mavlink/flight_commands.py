"""Flight commands: take-off, landing, return to home, change of height."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from fleet import GeoPoint, NotReady, Progress, Range, Refused, command
from fleet_mavlink.constants import Landed
from fleet_mavlink.preconditions import not_in_the_air, require_connection, require_has
from fleet_mavlink.session import VehicleSession
from fleet_mavlink.session_adapter import SessionAdapter

_Distance = Annotated[float, Range(-1000.0, 1000.0, "m")]  # the word says up or down, whatever the sign
_Height = Annotated[float, Range(0.0, 10_000.0, "m above home")]  # the vehicle's ceiling is lower


class FlightCommands(SessionAdapter):
    """Take-off, landing, return to home, and changes of height (m above home)."""

    @command("takeoff", timeout=90.0)
    async def takeoff(self, *, altitude: _Height | None = None) -> AsyncIterator[Progress]:
        """Arm if need be, and climb to an altitude (m above home)."""
        session = self._session
        flight, state = session.flight, session.vehicle.state
        require_connection(session.vehicle)
        require_has(session.vehicle, "takeoff")
        lowest = flight.flavour.lowest
        wanted = (
            min(max(self.config.takeoff_altitude, lowest), flight.ceiling) if altitude is None else altitude
        )
        if not lowest <= wanted <= flight.ceiling:
            raise Refused(f"{wanted:g} m is not {lowest:g} to {flight.ceiling:g} m above home")
        height = state.relative_altitude
        flies = state.in_air and state.landed is not Landed.TAKEOFF and not session.comes_down
        if flies and (altitude is None or (height is not None and height >= wanted)):
            climb = session.takeoff.stay()
        else:
            climb = self._to_height(session, wanted) if flies else session.takeoff.climb(wanted)
        async for progress in climb:
            yield progress

    @command("land", timeout=300.0, safe=True)
    async def land(self) -> AsyncIterator[Progress]:
        """Land here and switch the motors off; a plane on ArduPilot by the landing that its mission has."""
        session = self._session
        require_has(session.vehicle, "land")
        flavour = session.flight.flavour
        async for progress in session.flight.come_down(flavour.land, flavour.land_command()):
            yield progress

    @command("return_to_home", timeout=600.0, safe=True)
    async def return_to_home(self) -> AsyncIterator[Progress]:
        """Fly home, as the autopilot is set up to, and land; a plane circles there, a rover stands."""
        session = self._session
        flavour = session.flight.flavour
        comes = (
            session.navigator.go_home()
            if flavour.hovers_at_home
            else session.flight.come_down(flavour.return_home)
        )
        async for progress in comes:
            yield progress

    @command("cancel_takeoff", "cancel_landing", "cancel_return_to_home", safe=True)
    async def cancel(self) -> None:
        """Brake and hold here instead."""
        session = self._session
        require_connection(session.vehicle)
        await session.stop("cancelled", takes_over=True)

    @command("ascend", timeout=120.0)
    async def ascend(self, *, distance: _Distance) -> AsyncIterator[Progress]:
        """Climb by a distance (m)."""
        async for progress in self._climb_by(abs(distance)):
            yield progress

    @command("descend", timeout=120.0)
    async def descend(self, *, distance: _Distance) -> AsyncIterator[Progress]:
        """Sink by a distance (m); never to the ground."""
        async for progress in self._climb_by(-abs(distance)):
            yield progress

    async def _climb_by(self, metres: float) -> AsyncIterator[Progress]:
        """Change the height by ``metres``."""
        session = self._session
        require_has(session.vehicle, "ascend")
        height = session.vehicle.state.relative_altitude
        if height is None or not session.vehicle.state.in_air:
            raise not_in_the_air()
        async for progress in self._to_height(session, height + metres):
            yield progress

    async def _to_height(self, session: VehicleSession, height: float) -> AsyncIterator[Progress]:
        """Go to a height (m above home) at this place."""
        vehicle = session.vehicle
        here, home = vehicle.state.position, vehicle.state.home_altitude
        if here is None or home is None:
            raise NotReady("position or home is unknown")
        target = GeoPoint(here.latitude, here.longitude, home + height)
        async for progress in session.navigator.fly_to(target):
            yield progress
