"""Take-off: from the ground, right after a landing or during one, until the height is reached."""

from __future__ import annotations

from collections.abc import AsyncIterator

from fleet import CommandError, Fault, GeoPoint, Progress, Refused, TimedOut
from fleet_mavlink.constants import Landed
from fleet_mavlink.flight import Flight, height_of
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.preconditions import is_standing, known_heading, known_position, require_control
from fleet_mavlink.state import VehicleState
from fleet_mavlink.winged_takeoff import WingedTakeOff
from fleet_mavlink.wings import Winged

_ATTEMPTS = 3  # the end of a landing may switch the motors off during the first one
_BEGUN_WITHIN = 3.0  # s; the heartbeat that shows it is sent once a second
_OFF_GROUND_WITHIN = 20.0  # s after the take-off was accepted
_POLL = 0.5  # s between checks
_CLOSE = 0.3  # m, tolerated error of the reported height
_NEAR, _NEAR_SHARE = 0.5, 0.05  # m, and share of the height, tolerated if it gets no closer
_WITHIN = 0.1  # m from a limit, because home is reported to the centimetre
_SETTLES_WITHIN = 4.0  # s after its own end in which it still climbs to the given height
_CORRECTED_WITHIN = 15.0  # s
_CORRECTS_AT = 1.0  # m/s
_LATE = 0.5  # m by which a take-off may end below the autopilot's own tolerance
_TOLERANCE = 0.8  # m; PX4's default


class TakeOff:
    """Take-offs of one vehicle; ``under_way`` while one is running."""

    def __init__(self, flight: Flight, parameters: Parameters) -> None:
        self.under_way = False
        self._flight = flight
        self._vehicle = flight.vehicle
        self._parameters = parameters

    async def climb(self, altitude: float) -> AsyncIterator[Progress]:
        """Arm if necessary and climb to ``altitude`` m above home; yields once the autopilot accepts it.

        A vehicle that is higher (it lands, or returns home) holds instead. Raises the refusal, Refused also
        if it ended too low, Fault if the motors stopped, TimedOut.
        """
        require_control(self._vehicle, self._flight.authority)
        self.under_way = True
        try:
            flavour = self._flight.flavour
            if self._vehicle.state.in_air and height_of(self._vehicle.state) > altitude - _CLOSE:
                climb = self.stay()
            elif isinstance(flavour, Winged):
                climb = WingedTakeOff(self._flight, flavour, altitude).climb()
            else:
                climb = self._try(altitude)
            async for progress in climb:
                yield progress
        finally:
            self.under_way = False

    async def stay(self) -> AsyncIterator[Progress]:
        """Hold where it flies: the host has ended what it did before, and a take-off never descends."""
        flight = self._flight
        require_control(self._vehicle, flight.authority)
        flight.end_stream(flight.flavour, flight.flavour.hold)
        await flight.hold()
        yield Progress(100.0, "in the air already; a take-off never descends")

    async def _try(self, altitude: float) -> AsyncIterator[Progress]:
        """Take off; try again if the end of a landing switched the motors off in the meantime."""
        for _ in range(_ATTEMPTS):
            attempt = _Attempt(self._flight, self._parameters, altitude)
            if not await attempt.begin():
                continue
            async for progress in attempt.watch():
                yield progress
            if not attempt.landed:
                return
        raise Fault("the motors stopped before it left the ground", hint="look at the vehicle")


class _Attempt:
    """One attempt; ``landed``: a landing ended before it, so another attempt is needed."""

    def __init__(self, flight: Flight, parameters: Parameters, altitude: float) -> None:
        self.landed = False
        self._flight = flight
        self._vehicle = flight.vehicle
        self._parameters = parameters
        self._altitude = altitude
        self._armed_by_us = self._by_place = False
        self._left = ""  # mode that the take-off ended
        self._target = 0.0  # m AMSL

    async def begin(self) -> bool:
        """Arm and request the climb; False if a landing has just ended."""
        flight, flavour = self._flight, self._flight.flavour
        self._target = await flight.home.altitude() + self._altitude
        self._left = flight.mode(self._vehicle.state)
        self._armed_by_us = not self._vehicle.state.armed
        flight.end_stream(flavour, flavour.takeoff)
        if self._armed_by_us:
            await flight.arming.arm()
        elif flavour.takeoff == flavour.arming:
            await flight.be_in(flavour.arming)
        self._target = await flight.home.altitude() + self._altitude
        try:
            await self._request()
        except CommandError:
            if self._armed_by_us:
                await flight.arming.disarm_quietly()
                raise
            if not await self._vehicle.until(self._shows_why, _BEGUN_WITHIN):
                raise
            if self._has_landed(self._vehicle.state):
                return False
            await self._climb_on()
        return True

    def _shows_why(self, state: VehicleState) -> bool:
        """Return True if the telemetry, which lags, shows why: it has landed, or it flies already."""
        return self._has_landed(state) or self._climbs_unseen(state)

    def _climbs_unseen(self, state: VehicleState) -> bool:
        """Return True if it flies, and was asked for a take-off that it refuses in the air."""
        return bool(state.in_air) and not self._by_place and not self._flight.flavour.takes_off_in_air

    async def _climb_on(self) -> None:
        """Fly to the height by a position: the take-off before this one had left the ground unseen.

        It may be higher already.
        """
        self._by_place = True
        higher = max(0.0, height_of(self._vehicle.state) - self._altitude)
        self._altitude, self._target = self._altitude + higher, self._target + higher
        await self._go()

    async def _request(self) -> None:
        """Request the climb: by a take-off, or in the air, if that is refused there, by a position."""
        flight, flavour, vehicle = self._flight, self._flight.flavour, self._vehicle
        # A QuadPlane that has landed before says that it flies as soon as it is armed.
        flies = bool(vehicle.state.in_air) and not self._armed_by_us
        self._by_place = flies and not flavour.takes_off_in_air
        if self._by_place:
            await self._go()
            return
        request = flavour.takeoff_command(self._altitude, self._target - self._altitude)
        with flight.authority.requesting(flavour.arming, flavour.takeoff):
            await flight.commander.request(request, seen=self._obeyed)
        flight.mode_was_requested()

    def _obeyed(self, state: VehicleState) -> bool:
        """Return True if a vehicle that did not answer takes off nevertheless."""
        flavour = self._flight.flavour
        shown = self._flight.mode(state) == flavour.takeoff
        return shown and (flavour.takeoff != flavour.arming or _climbs(state))

    async def watch(self) -> AsyncIterator[Progress]:
        """Follow it to its height; ends early if it is disarmed on the ground."""
        yield Progress(0.0, "taking off")
        await self._vehicle.until(self._shows_it, _BEGUN_WITHIN)
        by, percent, climbed = self._vehicle.now() + _OFF_GROUND_WITHIN, 0.0, False
        while not await self._vehicle.until(self._is_up, _POLL):
            state = self._vehicle.state
            if not climbed and self._has_landed(state):
                self.landed = True
                return
            climbed = climbed or height_of(state) > 1.0
            self._flight.check(self._flight.flavour.arming, self._flight.flavour.takeoff)
            if self._vehicle.now() > by and not state.in_air:
                await self._give_up()
            percent = max(percent, min(99.0, 100 * height_of(state) / self._altitude))
            yield Progress(percent, f"at {height_of(state):.1f} m of {self._altitude:g} m")
        await self._require_end()
        await self._settle()
        yield Progress(100.0, f"at {height_of(self._vehicle.state):.1f} m")

    def _has_landed(self, state: VehicleState) -> bool:
        """Return True if a landing in progress has ended: motors off, or on the ground during a go."""
        if self._by_place and state.in_air is False:
            return True
        return not state.armed and not self._armed_by_us

    def _shows_it(self, state: VehicleState) -> bool:
        """Return True if the vehicle shows the take-off, has ended it, or is disarmed."""
        flavour, mode = self._flight.flavour, self._flight.mode(state)
        return mode == flavour.takeoff or not state.armed or mode == flavour.hold != self._left

    def _is_up(self, state: VehicleState) -> bool:
        """Return True if it stands at its height, or the autopilot has ended the take-off by itself."""
        flavour = self._flight.flavour
        if not state.armed:
            return False
        if flavour.takeoff != flavour.arming:
            return self._flight.mode(state) == flavour.hold and state.landed is Landed.IN_AIR
        return height_of(state) >= self._altitude - self._near and is_standing(state)

    @property
    def _near(self) -> float:
        """Tolerated error of its height in wind, m."""
        return max(_NEAR, _NEAR_SHARE * self._altitude)

    async def _give_up(self) -> None:
        """Undo the take-off, and raise TimedOut."""
        if self._armed_by_us:
            await self._flight.arming.disarm_quietly()
        raise TimedOut(f"it did not leave the ground in {_OFF_GROUND_WITHIN:g} s")

    async def _require_end(self) -> None:
        """Raise Refused if it is lower than the autopilot's own tolerance of a take-off."""
        here = self._vehicle.state.position
        short = self._target - here.altitude if here else 0.0
        if short <= _TOLERANCE + _LATE:
            return
        if short > await self._tolerance() + _LATE:
            raise Refused(f"the take-off ended at {height_of(self._vehicle.state):.1f} m")

    async def _tolerance(self) -> float:
        """Return the autopilot's own tolerance below the height of a take-off, m."""
        name = self._flight.flavour.takeoff_tolerance
        if name is None:
            return _CLOSE
        try:
            (parameter,) = await self._parameters.read([name])
        except CommandError:
            return _TOLERANCE
        return float(parameter.value)

    async def _settle(self) -> None:
        """Let it settle at its height above the present home; raises TimedOut if it does not."""
        vehicle, flavour = self._vehicle, self._flight.flavour
        climbs_to = self._target - await self._flight.home.altitude()  # home may have moved meanwhile
        aims_right = abs(climbs_to - self._altitude) <= _CLOSE
        if aims_right and await vehicle.until(self._at_height, _SETTLES_WITHIN):
            return
        await self._go()
        by = vehicle.now() + _CORRECTED_WITHIN
        while not await vehicle.until(self._at_height, _POLL):
            self._flight.check(flavour.goto)
            if vehicle.now() <= by:
                continue
            if abs(height_of(vehicle.state) - self._altitude) > self._near:
                raise TimedOut(f"it stays at {height_of(vehicle.state):.1f} m of {self._altitude:g} m")
            return

    async def _go(self) -> None:
        """Fly to the height above this position; stays slightly within a limit."""
        vehicle, flight = self._vehicle, self._flight
        here = known_position(vehicle)
        height = min(max(self._altitude, flight.flavour.lowest + _WITHIN), flight.ceiling - _WITHIN)
        above = GeoPoint(here.latitude, here.longitude, await flight.home.altitude() + height)
        await flight.go(above, _CORRECTS_AT, known_heading(vehicle))

    def _at_height(self, state: VehicleState) -> bool:
        """Return True if it stands at its height."""
        return abs(height_of(state) - self._altitude) <= _CLOSE and is_standing(state)


def _climbs(state: VehicleState) -> bool:
    """Return True if a vehicle that was on the ground is climbing."""
    return bool(state.in_air) or (state.velocity is not None and state.velocity.z < -_LATE)
