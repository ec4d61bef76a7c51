"""Braking a vehicle that is not moved here, whoever moves it, and seeing that it brakes."""

from __future__ import annotations

from fleet import NotReady, Refused, TimedOut
from fleet.errors import CommandError
from fleet_mavlink.commander import Commander, Superseded
from fleet_mavlink.flavour import arm_command
from fleet_mavlink.messages import Ask
from fleet_mavlink.preconditions import require_heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.vehicle_kind import Brake, VehicleKind

_STANDS = 0.25  # m/s; below it counts as standing
_SLOWED = 0.7  # share of its speed that it must be down to where it does not stand yet,
_SLOW = 0.5  # m/s, or this
_FRESH = 1.0  # s
_A_PAUSE = "a pause"
_WITHIN = 3.0  # s for all of it, of the 5 s that the host gives; ArduRover coasts 7 s from 3.5 m/s in HOLD
_AT_LEAST = 1.0  # s in which it must be seen to slow down, however long the change of mode took


class Brakes:
    """Brakes one vehicle; a stop that is not seen to work fails with what is seen instead."""

    def __init__(self, vehicle: Vehicle, commander: Commander) -> None:
        self._vehicle = vehicle
        self._commander = commander

    async def brake(self) -> None:
        """Brake; returns once it stands or slows down, for wings once the mode is shown in which they circle.

        Raises NotReady when it does not answer, Refused in the autopilot's words, TimedOut when it goes on.
        """
        vehicle = self._vehicle
        require_heartbeat(vehicle)
        kind = vehicle.kind
        if kind is None:
            raise NotReady("it is not known yet what it is")
        began, speed = vehicle.now(), self._speed(vehicle.state)
        shown = await self._engage(kind) if vehicle.state.armed else "the disarming"
        if kind.stands(vehicle.state):
            left = max(_AT_LEAST, _WITHIN - (vehicle.now() - began))
            await self._see(speed, left, shown)

    def first(self) -> Ask | None:
        """Return the command that brakes it best, None for what needs none; from any thread."""
        state, kind = self._vehicle.state, self._vehicle.kind
        if kind is None or not state.armed:
            return None
        return self._commander.addressed(kind.brakes(state)[0].ask)

    async def _engage(self, kind: VehicleKind) -> str:
        """Have it take the first brake that it does not refuse; return what it then shows."""
        refusals: list[CommandError] = []
        for brake in kind.brakes(self._vehicle.state):
            try:
                await self._take(brake, kind)
            except Superseded:
                raise  # by another stop: the next brake would be in its way
            except CommandError as error:
                refusals.append(error)
            else:
                return brake.mode or _A_PAUSE
        if kind.may_be_disarmed:
            self._vehicle.log.error("no mode brakes it (%s): it is disarmed", refusals[0])
            await self._commander.ask(arm_command(arm=False, force=True), seen=_is_disarmed)
            return "the disarming"
        said = "; ".join(str(each) for each in refusals)
        raise Refused(f"{self._vehicle.what} was not stopped: {said}", hint="stop it by other means")

    async def _take(self, brake: Brake, kind: VehicleKind) -> None:
        """Give one command, until its mode is shown."""
        if brake.mode:
            await self._commander.enter(brake.mode, kind.mode_of, brake.ask)
        else:
            await self._commander.ask(brake.ask, tries=2)

    async def _see(self, before: float | None, seconds: float, shown: str) -> None:
        """Wait until it stands; raises TimedOut when it does not even slow down."""
        vehicle = self._vehicle
        if before is None and shown != _A_PAUSE:
            return  # it tells no speed: the mode is all there is to be seen
        if await vehicle.until(self._stands, seconds):
            return
        now = self._speed(vehicle.state)
        if now is None or before is None or now > max(before * _SLOWED, _SLOW):
            seen = "does not tell how fast it is" if now is None else f"still moves at {now:.1f} m/s"
            raise TimedOut(f"{vehicle.what} took {shown} and {seen}", hint="stop it by other means")

    def _speed(self, state: VehicleState) -> float | None:
        """Return its speed over ground, None while it tells none."""
        fresh = self._vehicle.now() - state.position_at <= _FRESH
        return state.velocity.horizontal() if state.velocity is not None and fresh else None

    def _stands(self, state: VehicleState) -> bool:
        """Return whether it stands."""
        speed = self._speed(state)
        return speed is not None and speed <= _STANDS


def _is_disarmed(state: VehicleState) -> bool:
    """Return whether its motors are off."""
    return not state.armed
