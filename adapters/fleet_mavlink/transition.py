"""Transitions of a VTOL between its hover and its flight on wings; done when it was seen to fly so."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from typing import Literal

from fleet import Progress, TimedOut, command
from fleet_mavlink.ardupilot_plane import ArduPlane
from fleet_mavlink.constants import Cmd
from fleet_mavlink.flight import Flight
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.preconditions import require_control, require_has, require_movable
from fleet_mavlink.px4_plane import Px4Plane
from fleet_mavlink.session_adapter import SessionAdapter
from fleet_mavlink.state import VehicleState
from fleet_mavlink.wings import Winged

To = Literal["hover", "forward"]
_FLIES: Mapping[To, int] = {"hover": 3, "forward": 4}  # MAV_VTOL_STATE
_WITHIN = 60.0  # s
_POLL = 0.5  # s between checks
_WINGS: Mapping[str, Winged] = {"ardupilot": ArduPlane(), "px4": Px4Plane()}


class TransitionCommands(SessionAdapter):
    """The command of a VTOL."""

    @command("transition", timeout=120.0)
    async def transition(self, *, to: To) -> AsyncIterator[Progress]:
        """Go over to the hover, or to forward flight; a VTOL's."""
        async for progress in transition(self._session.flight, to):
            yield progress


async def transition(flight: Flight, to: To) -> AsyncIterator[Progress]:
    """Go over to another way to fly, here; raises the refusal, and TimedOut when it is not seen to."""
    vehicle, authority = flight.vehicle, flight.authority
    require_control(vehicle, authority)
    require_has(vehicle, "transition")
    require_movable(vehicle, authority)
    flavour = flight.flavour
    if to == "forward":
        _WINGS[flavour.name].airspeed(vehicle.state, flight.fastest, None)

    def flies(state: VehicleState) -> bool:
        return state.vtol_state == _FLIES[to]

    if not flies(vehicle.state):
        mode = flavour.transitions[to]
        flight.give_way(flavour, mode or flavour.hold)
        if mode:
            await flight.enter(mode)
        else:
            await flight.hold()
            await flight.commander.ask(
                CommandLong(Cmd.DO_VTOL_TRANSITION, param1=float(_FLIES[to])), seen=flies
            )
        by = vehicle.now() + _WITHIN
        while not await vehicle.until(flies, _POLL):
            flight.check(mode or flavour.hold)
            if vehicle.now() > by:
                raise TimedOut(f"it was not seen to fly {to} in {_WITHIN:g} s")
            yield Progress(50.0, "in transition")
    yield Progress(100.0, f"it flies {to}" if to == "forward" else "it hovers")
