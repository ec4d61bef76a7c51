"""Switches the motors of a vehicle on and off; done when the heartbeat shows it."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from contextlib import suppress

from fleet import CommandError, Refused, TimedOut
from fleet_mavlink.authority import Authority
from fleet_mavlink.commander import Commander
from fleet_mavlink.flavour import arm_command
from fleet_mavlink.preconditions import is_standing, moved_flavour, require_connection, require_heartbeat
from fleet_mavlink.remote_id import require_remote_id
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_SHOWN_WITHIN = 3.0  # s; the heartbeat that shows it is sent once a second


class Arming:
    """Arming of one vehicle; ``be_in(mode)`` enters a mode unless it is in it.

    The motors may run for a second before they are seen to: what switches them off then must not find them
    off already.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        commander: Commander,
        authority: Authority,
        be_in: Callable[[str], Awaitable[None]],
    ) -> None:
        self._vehicle = vehicle
        self._commander = commander
        self._authority = authority
        self._be_in = be_in
        self._seen_by = -math.inf  # time by which an arming that was asked for is shown

    async def arm(self, *, force: bool = False) -> None:
        """Arm, in a mode that allows take-off; raises Refused or NotReady with the autopilot's reason."""
        require_connection(self._vehicle)
        if self._vehicle.state.armed:
            return
        flavour = moved_flavour(self._vehicle)
        require_remote_id(self._vehicle)
        await self._be_in(flavour.arming)
        self._authority.expect(flavour.arming)
        try:
            await self._switch(on=True, force=force)
        except Refused as refusal:
            landed = flavour.lands_once and any(flavour.lands_once in each for each in refusal.messages)
            if not landed or flavour.rewind is None:
                raise
            await self._commander.request(flavour.rewind)
            await self._switch(on=True, force=force)

    async def disarm(self, *, force: bool = False) -> None:
        """Disarm on the ground; raises Refused in the air, even with ``force``."""
        require_connection(self._vehicle)
        if not await self.has_motors_on():
            return
        state = self._vehicle.state
        if state.in_air:
            raise Refused("it is in the air and would fall", hint="send land")
        if state.on_the_surface and not is_standing(state):
            raise Refused("it moves, and would coast", hint="send stop first")
        if not state.on_the_surface and force and state.in_air is None:
            raise Refused("it is not known to be on the ground", hint="disarm without force, or land")
        try:
            await self._switch(on=False, force=False)
        except CommandError as refusal:
            # What the autopilot refuses may fly, unseen: its telemetry lags.
            if not force or refusal.device_result is None or await self._flies_after_all():
                raise
            await self._switch(on=False, force=True)

    async def has_motors_on(self) -> bool:
        """Return whether its motors run; waits for what shows it if they may just have been started."""
        left = self._seen_by - self._vehicle.now()
        return self._vehicle.state.armed or await self._vehicle.until(lambda state: state.armed, left)

    async def _flies_after_all(self) -> bool:
        """Return whether a vehicle that was last reported on the ground is seen to fly."""
        return await self._vehicle.until(lambda state: bool(state.in_air), _SHOWN_WITHIN)

    async def _switch(self, *, on: bool, force: bool) -> None:
        """Send the command, and wait until the heartbeat shows its effect."""

        def shown(state: VehicleState) -> bool:
            return state.armed is on

        self._seen_by = self._vehicle.now() + _SHOWN_WITHIN if on else -math.inf
        try:
            await self._commander.request(arm_command(arm=on, force=force), seen=shown)
        except CommandError as error:
            self._seen_by = -math.inf if error.device_result is not None else self._seen_by
            raise
        if not await self._vehicle.until(shown, _SHOWN_WITHIN):
            raise TimedOut(f"it took the command but is not {'armed' if on else 'disarmed'}")

    async def disarm_quietly(self) -> None:
        """Disarm again after a take-off that did not happen."""
        if self._vehicle.state.in_air is False:
            with suppress(CommandError):
                await self._switch(on=False, force=False)

    async def kill(self) -> None:
        """Stop the motors at once, even in the air; return once the heartbeat shows it."""
        require_heartbeat(self._vehicle)
        unseen = self._seen_by
        if self._vehicle.state.armed or self._vehicle.now() < unseen:
            await self._switch(on=False, force=True)
            self._seen_by = unseen
        if await self.has_motors_on():  # started by what was asked for before
            await self._switch(on=False, force=True)
