"""Control of a gimbal, to angles and at rates, with the MAVLink gimbal manager of both autopilots."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable

import msgspec

from fleet import CommandError, FleetError, NotReady, Refused, TimedOut, Unsupported
from fleet_mavlink.commander import Commander
from fleet_mavlink.constants import NAN, MavCmd
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.onboard_sensors import GimbalAngles
from fleet_mavlink.payload_messages import GimbalManagerInformation
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

LEASE = 1.0  # s for which a rate is held unless it is commanded again
_LOCKS = 12.0  # flags: roll and pitch lock to the horizon, yaw to the vehicle
_NOBODY_ELSE = -1.0  # leaves the secondary control unchanged
_INFORMED_WITHIN = 1.0  # s
_THERE = 3.0  # degrees
_TURNS_WITHIN = 15.0  # s
_FASTEST = 360.0  # degrees per second
_SLACK = 0.5  # degrees beyond a limit that still count as the limit


class GimbalTurn(msgspec.Struct, frozen=True):
    """Target of a turn, degrees; None leaves an axis unchanged. ``seconds``: duration of the turn."""

    pitch: float | None
    yaw: float | None
    relative: bool = False
    seconds: float = 0.0


class Gimbal:
    """The gimbal of one vehicle; takes control of it before the first turn."""

    def __init__(
        self,
        vehicle: Vehicle,
        commander: Commander,
        station: tuple[int, int],
        spawn: Callable[[Awaitable[None]], asyncio.Task[None]],
    ) -> None:
        self._vehicle = vehicle
        self._commander = commander
        self._station = station
        self._spawn = spawn
        self._manager: GimbalManagerInformation | None = None
        self._met_at_boot = -1
        self._ending: asyncio.Task[None] | None = None

    async def turn(self, turn: GimbalTurn) -> None:
        """Turn to angles; return once they are seen, if the gimbal reports its attitude."""
        manager = await self._take_control()
        aim = self._aim_of(turn, manager)
        rates = self._rates_to(aim, turn.seconds) if turn.seconds > 0 else None
        self._keep()
        if rates is not None:
            await self._turn_slowly(*rates, turn.seconds)
        await self._request(pitch=_or_nan(aim.pitch), yaw=_or_nan(aim.yaw))
        self._keep()
        if self._vehicle.state.sensors.aim is None:
            return  # no attitude report: the manager's acknowledgement is the only evidence

        def there(state: VehicleState) -> bool:
            seen = state.sensors.aim
            return seen is not None and _near(seen, aim)

        if not await self._vehicle.until(there, _TURNS_WITHIN):
            raise TimedOut("the gimbal took the command but does not turn there")

    async def spin(self, pitch: float, yaw: float) -> None:
        """Turn at rates, degrees per second, for ``LEASE`` seconds or until the next call."""
        if not all(math.isfinite(each) and abs(each) <= _FASTEST for each in (pitch, yaw)):
            raise Refused(f"a turning speed is within {_FASTEST:g} degrees a second")
        await self._take_control()
        self._keep()
        try:
            await self._request(pitch_rate=pitch, yaw_rate=yaw)
        finally:
            self._end_after(LEASE)

    def _end_after(self, seconds: float) -> None:
        """Schedule the end of a spin: also of one that was not acknowledged, as it may turn nevertheless."""
        self._keep()
        self._ending = self._spawn(self._end_spin(seconds))

    async def _end_spin(self, seconds: float) -> None:
        """Stop turning after a time."""
        await asyncio.sleep(seconds)
        try:
            await self._request(pitch_rate=0.0, yaw_rate=0.0)
        except FleetError as error:
            self._vehicle.log.warning("the gimbal may still turn: %s", error)
        self._ending = None

    def _keep(self) -> None:
        """Cancel the scheduled end of a spin, because of a newer command."""
        if self._ending is not None:
            self._ending.cancel()
            self._ending = None

    def _rates_to(self, aim: _GimbalTarget, seconds: float) -> tuple[float, float]:
        """Return the rates that arrive in time; raises NotReady while the present angles are unknown."""
        seen = self._vehicle.state.sensors.aim
        if seen is None:
            raise NotReady("the gimbal does not say how it is turned", hint="leave the duration out")
        return _speed(seen.pitch, aim.pitch, seconds), _speed(seen.yaw, aim.yaw, seconds)

    async def _turn_slowly(self, pitch: float, yaw: float, seconds: float) -> None:
        """Turn at rates for a time; the end is scheduled, in case the angles are never commanded."""
        try:
            await self._request(pitch_rate=pitch, yaw_rate=yaw)
            await asyncio.sleep(seconds)
        finally:
            self._end_after(LEASE)

    def _aim_of(self, turn: GimbalTurn, manager: GimbalManagerInformation) -> _GimbalTarget:
        """Return the target angles; raises Refused beyond the gimbal's limits."""
        seen = self._vehicle.state.sensors.aim
        if turn.relative and seen is None:
            raise NotReady("the gimbal does not say how it is turned", hint="give absolute angles")
        base = seen if turn.relative and seen is not None else GimbalAngles(0.0, 0.0)
        pitch = None if turn.pitch is None else base.pitch + turn.pitch
        yaw = None if turn.yaw is None else base.yaw + turn.yaw
        _require_within("pitch", pitch, manager.pitch_min, manager.pitch_max)
        _require_within("yaw", yaw, manager.yaw_min, manager.yaw_max)
        return _GimbalTarget(pitch, yaw)

    async def _take_control(self) -> GimbalManagerInformation:
        """Find the gimbal manager, once after each boot, and take control; raises Unsupported without one."""
        require_connection(self._vehicle)
        reboots = self._vehicle.state.reboots
        if self._manager is None or self._met_at_boot != reboots:
            self._manager = await self._find()
            system, component = map(float, self._station)
            request = CommandLong(
                MavCmd.DO_GIMBAL_MANAGER_CONFIGURE,
                param1=system,
                param2=component,
                param3=_NOBODY_ELSE,
                param4=_NOBODY_ELSE,
            )
            await self._commander.request(request)
            self._met_at_boot = reboots
        return self._manager

    async def _find(self) -> GimbalManagerInformation:
        """Request the gimbal manager's information from the autopilot."""
        request = CommandLong(MavCmd.REQUEST_MESSAGE, param1=float(GimbalManagerInformation.message_id))
        with self._vehicle.hearing(GimbalManagerInformation) as heard:
            try:
                await self._commander.request(request)
            except CommandError as error:
                if error.device_result is None:
                    raise
                raise Unsupported("the autopilot has no gimbal", device_result=error.device_result) from None
            found = await heard.next(_INFORMED_WITHIN)
        if found is None:
            raise Unsupported("the autopilot reports no gimbal")
        return found

    async def _request(
        self, *, pitch: float = NAN, yaw: float = NAN, pitch_rate: float = NAN, yaw_rate: float = NAN
    ) -> None:
        """Send a pitch/yaw command; NaN leaves an axis unchanged."""
        try:
            await self._commander.request(
                CommandLong(
                    MavCmd.DO_GIMBAL_MANAGER_PITCHYAW,
                    param1=pitch,
                    param2=yaw,
                    param3=pitch_rate,
                    param4=yaw_rate,
                    param5=_LOCKS,
                )
            )
        except FleetError:
            self._manager = None  # another station may have taken control: it is taken again next time
            raise


class _GimbalTarget(msgspec.Struct, frozen=True):
    """Target angles, degrees; None: unchanged."""

    pitch: float | None
    yaw: float | None


def _or_nan(angle: float | None) -> float:
    """Return an angle, NaN for an unchanged axis."""
    return NAN if angle is None else angle


def _speed(now: float, then: float | None, seconds: float) -> float:
    """Return the rate from one angle to another, NaN for an unchanged axis."""
    return NAN if then is None else (then - now) / seconds


def _near(seen: GimbalAngles, target: _GimbalTarget) -> bool:
    """Return True if the requested axes are near their targets."""
    pairs = ((seen.pitch, target.pitch), (seen.yaw, target.yaw))
    return all(then is None or abs(math.remainder(now - then, 360.0)) <= _THERE for now, then in pairs)


def _require_within(axis: str, angle: float | None, lowest: float, highest: float) -> None:
    """Raise Refused for an invalid angle, or one beyond the limits (radians; equal ones: not reported)."""
    if angle is None:
        return
    if not math.isfinite(angle) or abs(angle) > 360.0:
        raise Refused(f"{axis} must be degrees within a turn")
    low, high = math.degrees(lowest), math.degrees(highest)
    if low < high and not low - _SLACK <= angle <= high + _SLACK:
        raise Refused(f"{axis} {angle:g} is not within the gimbal's {low:.0f} to {high:.0f} degrees")
