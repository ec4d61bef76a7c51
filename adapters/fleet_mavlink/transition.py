"""Transitions of a VTOL between hover and forward flight; done when seen in its VTOL state."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Mapping
from typing import Literal

from fleet import Progress, Refused, TimedOut, command
from fleet_mavlink.constants import VTOL_GOES_FORWARD, MavCmd
from fleet_mavlink.flight import Flight
from fleet_mavlink.messages import CommandLong, ExtendedSysState
from fleet_mavlink.preconditions import require_control, require_has, require_movable
from fleet_mavlink.px4_plane import Px4Plane
from fleet_mavlink.session_adapter import SessionAdapter
from fleet_mavlink.state import VehicleState

To = Literal["hover", "forward"]
_FLIES: Mapping[To, int] = {"hover": 3, "forward": 4}  # MAV_VTOL_STATE
_GOES: Mapping[To, int] = {"hover": 2, "forward": VTOL_GOES_FORWARD}
_WITHIN = 60.0  # s
_POLL = 0.5  # s between checks
_PX4 = Px4Plane()


class TransitionCommands(SessionAdapter):
    """Command of VTOLs."""

    @command("transition", timeout=120.0)
    async def transition(self, *, to: To) -> AsyncIterator[Progress]:
        """Change to hover or to forward flight; VTOLs only."""
        async for progress in transition(self._session.flight, to):
            yield progress


async def _begin(flight: Flight, to: To) -> None:
    """Request a transition, unless it is in progress already.

    It is also requested of a vehicle that flies so: it may have started the opposite one without reporting
    it. It then holds, because the host has ended its previous motion.
    """
    vehicle, flavour = flight.vehicle, flight.flavour
    mode = flavour.transitions[to]
    flight.end_stream(flavour, mode or flavour.hold)
    if mode and vehicle.state.vtol_state == _FLIES[to]:
        await flight.hold()
        return
    if mode:
        await flight.enter(mode)
        return
    if vehicle.state.vtol_state == _GOES[to] and flight.mode(vehicle.state) == flavour.hold:
        return
    await flight.hold()
    request = CommandLong(MavCmd.DO_VTOL_TRANSITION, param1=float(_FLIES[to]))
    await flight.commander.request(request, seen=lambda state: state.vtol_state in {_GOES[to], _FLIES[to]})


async def transition(flight: Flight, to: To) -> AsyncIterator[Progress]:
    """Change the flight state at this position; raises the refusal, TimedOut if it is not seen in time."""
    vehicle, authority = flight.vehicle, flight.authority
    require_control(vehicle, authority)
    require_has(vehicle, "transition")
    require_movable(vehicle, authority)
    flavour = flight.flavour
    if to == "forward":
        wings = flavour.forward or _PX4
        wings.speed_to(vehicle.state, flight.fastest, None, math.inf)

    mode = flavour.transitions[to] or flavour.hold
    await _begin(flight, to)
    requested = vehicle.now()

    def flies(state: VehicleState) -> bool:
        fresh = vehicle.seen_at.get(ExtendedSysState, -math.inf) > requested
        return fresh and state.vtol_state == _FLIES[to]

    started = False
    while not await vehicle.until(flies, _POLL):
        flight.check(mode)
        started = started or vehicle.state.vtol_state == _GOES[to]
        if started and vehicle.state.vtol_state not in {_GOES[to], _FLIES[to]}:
            raise Refused("the transition was broken off")
        if vehicle.now() > requested + _WITHIN:
            raise TimedOut(f"it was not seen to fly {to} in {_WITHIN:g} s")
        yield Progress(50.0, "in transition")
    yield Progress(100.0, f"it flies {to}" if to == "forward" else "it hovers")
