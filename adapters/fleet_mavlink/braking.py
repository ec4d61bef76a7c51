"""Braking of a vehicle that this adapter does not move, verified by its speed."""

from __future__ import annotations

from collections.abc import Iterator

from fleet import CommandError, NotReady, Refused, TimedOut, Vector3
from fleet_mavlink.command_queue import Superseded
from fleet_mavlink.commander import Commander
from fleet_mavlink.constants import VTOL_HOVERS
from fleet_mavlink.flavour import arm_command, ned_setpoint
from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.motion_effect import Effect
from fleet_mavlink.preconditions import require_heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.unknown_kind import UnknownKind
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.vehicle_kind import Brake, VehicleKind

_UNKNOWN = UnknownKind()
_STANDS = 0.25  # m/s; slower counts as standing
_SLOW = 0.5  # m/s; below, whatever it was stopped at, it has slowed down
_FRESH = 1.0  # s
_A_PAUSE = "a pause"
_WITHIN = 3.0  # s for the whole stop, of the host's 5 s; ArduRover coasts 7 s from 3.5 m/s in HOLD
_AT_LEAST = 1.0  # s for observing the speed, however long the change of mode took


class Brakes:
    """Brakes one vehicle; a stop without visible effect fails, with the observed state as the reason."""

    def __init__(self, vehicle: Vehicle, commander: Commander) -> None:
        self._vehicle = vehicle
        self._commander = commander

    async def brake(self) -> None:
        """Brake; return once the vehicle stands or slows down, a plane once it is in its circling mode.

        Raises NotReady if it does not answer, Refused with the autopilot's reason, TimedOut if it does not
        slow down.
        """
        vehicle = self._vehicle
        require_heartbeat(vehicle)
        kind = vehicle.kind
        if kind is None:
            raise NotReady("its vehicle type is not known yet")
        began, speed = vehicle.now(), self._speed(vehicle.state)
        shown = await self._engage(kind) if vehicle.state.armed else "the disarming"
        left = max(_AT_LEAST, _WITHIN - (vehicle.now() - began))
        if kind.goes_over:
            await self._see_hover(left, shown)
        elif kind.stands(vehicle.state):
            await self._see(kind, speed, left, shown)

    def messages(self) -> Iterator[MavlinkMessage]:
        """Yield the best braking messages for a vehicle that is not moved here; from any thread.

        One from which nothing was received may be of any kind: it gets a zero velocity, which every autopilot
        follows in its external mode and ignores in the others, and a pause. Each autopilot has other numbers
        for its modes.
        """
        state, kind = self._vehicle.state, self._vehicle.kind
        if kind is None:
            kind = _UNKNOWN
            yield ned_setpoint(Vector3(), 0.0, self._vehicle.system)
        yield self._commander.addressed(kind.brakes(state)[0].request)

    async def _engage(self, kind: VehicleKind) -> str:
        """Try the brakes in order until one is not refused; return the mode that is then shown."""
        refusals: list[CommandError] = []
        for brake in kind.brakes(self._vehicle.state):
            try:
                await self._send(brake, kind)
            except Superseded:
                raise  # superseded by another stop: trying the next brake would disturb it
            except CommandError as error:
                refusals.append(error)
            else:
                return brake.mode or _A_PAUSE
        if kind.may_be_disarmed:
            self._vehicle.log.error("no mode brakes it (%s): it is disarmed", refusals[0])
            await self._commander.request(arm_command(arm=False, force=True), seen=_is_disarmed)
            return "the disarming"
        said = "; ".join(str(each) for each in refusals)
        raise Refused(f"{self._vehicle.what} was not stopped: {said}", hint="stop it by other means")

    async def _send(self, brake: Brake, kind: VehicleKind) -> None:
        """Send one brake command until its mode is shown."""
        if brake.first is not None:
            await self._commander.request(brake.first.request, tries=2, effect=Effect.NONE)
        if brake.mode:
            await self._commander.enter(brake.mode, kind.mode_of, brake.request, effect=Effect.NONE)
        else:
            await self._commander.request(brake.request, tries=2)

    async def _see(self, kind: VehicleKind, before: float | None, seconds: float, shown: str) -> None:
        """Wait until the vehicle stands; raises TimedOut if it does not even slow down."""
        vehicle = self._vehicle
        if before is None and shown != _A_PAUSE:
            return  # it reports no speed: the mode is the only evidence
        if await vehicle.until(self._stands, seconds):
            return
        now = self._speed(vehicle.state)
        if now is None or before is None or now > max(kind.slows_to(before), _SLOW):
            seen = "reports no speed" if now is None else f"still moves at {now:.1f} m/s"
            raise TimedOut(f"{vehicle.what} took {shown} and {seen}", hint="stop it by other means")

    async def _see_hover(self, seconds: float, shown: str) -> None:
        """Wait until a VTOL hovers again; raises TimedOut if its transition continues."""
        vehicle = self._vehicle
        if not await vehicle.until(lambda state: state.vtol_state in VTOL_HOVERS, seconds):
            raise TimedOut(
                f"{vehicle.what} took {shown} and is not seen to hover again", hint="stop it by other means"
            )

    def _speed(self, state: VehicleState) -> float | None:
        """Return its ground speed, m/s; None without a recent one."""
        fresh = self._vehicle.now() - state.position_at <= _FRESH
        return state.velocity.horizontal() if state.velocity is not None and fresh else None

    def _stands(self, state: VehicleState) -> bool:
        """Return True while it stands."""
        speed = self._speed(state)
        return speed is not None and speed <= _STANDS


def _is_disarmed(state: VehicleState) -> bool:
    """Return True while its motors are off."""
    return not state.armed
