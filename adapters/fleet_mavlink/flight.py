"""Flight procedures: hold, land, return; each ends when the vehicle is seen to have done it."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable

from fleet import (
    CommandError,
    Fault,
    GeoOrigin,
    GeoPoint,
    Limits,
    LinkError,
    Progress,
    Refused,
    world_from_geo,
)
from fleet_mavlink.arming import Arming
from fleet_mavlink.authority import Authority
from fleet_mavlink.commander import Commander
from fleet_mavlink.constants import MavCmd
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.home_position import VehicleHome
from fleet_mavlink.messages import CommandLong, MavlinkCommand, SetPositionTargetGlobalInt
from fleet_mavlink.motion_effect import Effect, effect_of_descent
from fleet_mavlink.preconditions import home_unknown, moved_flavour, require_connection, require_heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_SHOWN_WITHIN = 3.0  # s, for the modes that it had in between: heartbeats are sent once a second
_POLL = 0.5  # s between checks of a long procedure
FARTHEST = 100_000.0  # m; a farther goal is a mistake, such as a wrong unit or swapped coordinates


class Flight:
    """Procedures of one vehicle.

    ``end_stream(mode)`` ends the stream of setpoints before a command that leads to ``mode``.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        commander: Commander,
        authority: Authority,
        limits: Limits,
        end_stream: Callable[[Flavour, str], None],
    ) -> None:
        self.vehicle = vehicle
        self.commander = commander
        self.authority = authority
        self.ceiling = limits.altitude or math.inf
        self.fastest = limits.speed
        self.descent = ""  # mode of the last landing, or return home
        self._entered_at = -math.inf  # time of the last change of mode that was accepted
        self._farthest = limits.distance or FARTHEST
        self.end_stream = end_stream
        self.home = VehicleHome(vehicle, commander)
        self.arming = Arming(vehicle, commander, authority, self.be_in)

    @property
    def flavour(self) -> Flavour:
        """Flavour of the autopilot; raises NotReady before a heartbeat, Unsupported if not moved here."""
        return moved_flavour(self.vehicle)

    def mode(self, state: VehicleState) -> str:
        """Return the name of the mode in a state."""
        return self.flavour.mode_of(state)

    async def enter(
        self, mode: str, request: MavlinkCommand | None = None, *, effect: Effect = Effect.MOTION
    ) -> None:
        """Change to a mode, by a command that leads to it or by the mode command; return once it is shown.

        ``effect`` decides whether a halt in the meantime ends the change: one mode may serve holds and
        motion. Allowed even while two vehicles use the same id, because a hold must always be possible.
        """
        require_heartbeat(self.vehicle)
        flavour = self.flavour
        with self.authority.requesting(mode):
            change = request or flavour.mode_command(mode)
            await self.commander.enter(mode, flavour.mode_of, change, effect=effect)
        self.descent = ""
        self.mode_was_requested()

    def mode_was_requested(self) -> None:
        """Note that a command that leads to another mode was accepted."""
        self._entered_at = self.vehicle.now()

    async def be_in(self, mode: str) -> None:
        """Enter a mode unless it is surely in it."""
        shown = self.mode(self.vehicle.state)
        if shown != mode or self.commander.changes_mode(shown):
            await self.enter(mode)

    async def enter_external(self) -> None:
        """Change to the mode that follows setpoints."""
        await self.enter(self.flavour.external)

    async def hold(self) -> None:
        """Brake and stay; return once the holding mode is shown."""
        require_heartbeat(self.vehicle)
        brake = self.flavour.holding(self.vehicle.state)
        with self.authority.requesting(*brake.modes):
            if brake.first is not None:
                await self.commander.request(brake.first.request, tries=2, effect=Effect.NONE)
            await self.commander.enter(brake.mode, self.flavour.mode_of, brake.request, effect=Effect.NONE)
        self.descent = ""
        self.mode_was_requested()

    async def hold_if_ours(self) -> None:
        """Hold after a failure, unless we have no authority or it cannot be reached.

        A failure of the hold is only logged, so that the first failure is the reported one.
        """
        if not self.vehicle.connected or not self.vehicle.state.armed or self.authority.lost_to:
            return
        try:
            await self.hold()
        except (CommandError, LinkError) as error:
            self.vehicle.log.warning("it does not hold: %s", error)

    async def come_down(self, mode: str, request: MavlinkCommand | None = None) -> AsyncIterator[Progress]:
        """Land or return home by a mode of the autopilot; ends on the ground with the motors off.

        ``request``: the command that leads to the mode, if it is not the mode command.
        """
        require_connection(self.vehicle)
        start = height_of(self.vehicle.state)
        if not await self.arming.has_motors_on():
            yield Progress(100.0, "on the ground")
            return
        self.end_stream(self.flavour, mode)
        await self.enter(mode, request, effect=effect_of_descent(self.flavour))
        self.descent = mode
        percent = 0.0
        while not await self.vehicle.until(lambda state: not state.armed, _POLL):
            height = height_of(self.vehicle.state)
            self.check(mode)
            percent = max(percent, min(99.0, 100 * (1 - height / max(start, 1.0))))
            yield Progress(percent, f"at {height:.1f} m")
        self.descent = ""
        yield Progress(100.0, "on the ground")

    async def go(self, to: GeoPoint, speed: float, heading: float, *, backwards: bool = False) -> None:
        """Start towards a position with the nose at ``heading``; return once the autopilot has accepted it.

        Raises Refused above the ceiling.
        """
        self.require_altitude(to.altitude)
        flavour = self.flavour
        self.end_stream(flavour, flavour.goto)
        before = flavour.command_before_go(backwards=backwards)
        if before is not None:
            await self.be_in(flavour.goto)  # a change of mode resets what ``before`` sets
            await self.commander.request(before)
        go = flavour.go_command(to, await self.home.altitude(), speed, heading)
        if isinstance(go, SetPositionTargetGlobalInt):
            await self.be_in(flavour.goto)
            await self.commander.send_to(go, to.altitude)
        else:
            await self.enter(flavour.goto, go)
        following = flavour.command_after_go(speed, self.vehicle.state)
        if following is not None:
            await self.commander.request(following)

    def require_altitude(self, altitude: float) -> None:
        """Raise unless an altitude (m AMSL) is between the lowest height above home and the ceiling.

        Vehicles on the surface have no such limits.
        """
        if self.vehicle.state.on_the_surface:
            return
        home = self.vehicle.state.home_altitude
        if home is None:
            raise home_unknown()
        height = altitude - home
        if not height <= self.ceiling:
            raise Refused(f"{height:.1f} m above home is over the limit of {self.ceiling:g} m")
        lowest = self.flavour.lowest
        if height < lowest:
            raise Refused(
                f"{height:.1f} m above home is below {lowest:g} m", hint="use land, or check the origin"
            )

    def require_distance(self, point: GeoPoint, around: float = 0.0) -> None:
        """Raise unless a position, and ``around`` m around it, is within the distance limit from home."""
        home = self.vehicle.state.home
        if home is None:
            raise home_unknown()
        away = world_from_geo(GeoOrigin(home.latitude, home.longitude), point).horizontal() + around
        if not away <= self._farthest:
            raise Refused(f"{away:.0f} m from home is beyond the limit of {self._farthest:g} m")

    async def reboot(self) -> None:
        """Restart the autopilot; raises Refused while it is armed."""
        require_connection(self.vehicle)
        if self.vehicle.state.armed:
            raise Refused("it is armed", hint="land and disarm first")
        reboots = self.vehicle.state.reboots
        request = CommandLong(MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, param1=1.0)
        await self.commander.request(request, seen=lambda state: state.reboots > reboots, tries=1)

    def check(self, *modes: str) -> None:
        """Raise unless the flight continues as commanded: connected, ours, armed, in one of these modes."""
        state = self.vehicle.state
        require_connection(self.vehicle)
        if self.authority.lost_to:
            raise Refused(f"taken over: the vehicle is in {self.authority.taker}")
        if not state.armed:
            raise Fault("the motors stopped on the way", hint="look at the vehicle")
        if self.mode(state) not in modes and not self._is_shown_late(self.mode(state)):
            raise Refused(f"another command changed the mode to {self.mode(state)}")

    def _is_shown_late(self, mode: str) -> bool:
        """Return True for a mode that was asked for before the present one, and may be shown first."""
        just_entered = self.vehicle.now() - self._entered_at < _SHOWN_WITHIN
        return just_entered and self.authority.requested_before(mode)

    async def wait(self, seconds: float, *modes: str) -> None:
        """Wait for a time, checking that the flight continues as commanded."""
        by = self.vehicle.now() + seconds
        while (left := by - self.vehicle.now()) > 0:
            self.check(*modes)
            await asyncio.sleep(min(left, _POLL))


def height_of(state: VehicleState) -> float:
    """Return metres above home, 0 while unknown."""
    return state.relative_altitude or 0.0
