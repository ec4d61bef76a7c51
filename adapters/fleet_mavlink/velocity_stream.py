"""Velocity control: streams setpoints during a drive, and ends only with a confirmed hold."""

from __future__ import annotations

import asyncio
import enum
import math
from collections.abc import Awaitable, Callable

from fleet import ZERO_VELOCITY, FleetError, NotReady, Refused, Unsupported, Vector3, Velocity
from fleet_mavlink.authority import Authority
from fleet_mavlink.command_queue import Superseded
from fleet_mavlink.flavour import Flavour, ned_setpoint
from fleet_mavlink.preconditions import require_movable
from fleet_mavlink.vehicle import Vehicle

PERIOD = 0.05  # s between setpoints
_AGAIN = 1.0  # s until a refused mode is requested again
_LATE = 2.0  # s until the next mode is shown, if this one was left already


class StreamPhase(enum.Enum):
    """Phase of a drive."""

    IDLE = "idle"  # nothing is streamed
    STARTING = "starting"  # the newest velocity, until the vehicle shows that it accepts setpoints
    DRIVING = "driving"  # the newest velocity
    BRAKING = "braking"  # zero velocity, until the vehicle holds by itself


IDLE, STARTING, DRIVING, BRAKING = StreamPhase
"""For the checks of every setpoint: in Python 3.11 a lookup on the enumeration takes ten times as long."""


class VelocityStream:
    """Stream of setpoints to one vehicle; ``tick`` is called every ``PERIOD``; no method blocks.

    ``enter`` requests the mode that accepts setpoints, ``hold`` the mode that holds the position; both run in
    the background, by ``spawn``, until the heartbeat shows the mode. ``busy``: another command is running;
    its mode may be shown late, and a hold after it would undo it.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        authority: Authority,
        *,
        ceiling: float,
        enter: Callable[[], Awaitable[None]],
        hold: Callable[[], Awaitable[None]],
        spawn: Callable[[Awaitable[None]], asyncio.Task[None]],
        busy: Callable[[], bool],
    ) -> None:
        self.phase = IDLE
        self.halted = False  # set by another thread: brake at the next tick
        self._vehicle = vehicle
        self._authority = authority
        self._ceiling = ceiling
        self._enter = enter
        self._hold = hold
        self._spawn = spawn
        self._busy = busy
        self._wanted = ZERO_VELOCITY
        self._since = 0.0  # time of the last request for motion
        self._since_phase = 0.0
        self._task: asyncio.Task[None] | None = None
        self._refusal: FleetError | None = None
        self._again_at = -math.inf
        self._must_request = False

    @property
    def drives(self) -> bool:
        """True while the newest velocity is streamed."""
        return self.phase is STARTING or self.phase is DRIVING

    def drive(self, velocity: Velocity) -> None:
        """Set the newest velocity, and send it at once, not with the next tick.

        Raises NotReady or Refused if the vehicle cannot be driven, LinkLost.
        """
        moves = not velocity.is_zero
        if not moves and self.phase is IDLE:
            return
        flavour, now = self._vehicle.flavour, self._vehicle.now()
        if moves:
            self._require(velocity, flavour, now)
        if moves or not self._wanted.is_zero:
            self._since = now
        self._wanted = velocity
        if self.phase is IDLE or (self.phase is BRAKING and moves):
            # After braking the shown mode may be outdated: the hold may have been entered since.
            self._must_request = self.phase is BRAKING
            self._again_at = -math.inf if self._refusal is None else self._again_at
            self._to(STARTING)
        if self.phase is not BRAKING and (moves or self._is_ours()):
            self._stream(flavour, now)

    def rest(self) -> bool:
        """End a drive gently: zero velocity now, the hold a moment later; False without a drive.

        This avoids two changes of mode between the bursts of an intermittent drive.
        """
        if not self.drives:
            return False
        self.drive(ZERO_VELOCITY)
        return True

    def _require(self, velocity: Velocity, flavour: Flavour | None, now: float) -> None:
        """Raise unless we may move the vehicle now; Unsupported for a motion that it lacks."""
        linear = velocity.linear
        if not math.isfinite(linear.x + linear.y + linear.z + velocity.yaw_rate):
            raise Refused("a velocity must be made of finite numbers")
        turns_in_place = self._vehicle.turns_in_place
        if flavour and (why := flavour.cannot(velocity, turns_in_place=turns_in_place)):
            raise Unsupported(why)
        require_movable(self._vehicle, self._authority)
        if self._refusal is not None and now < self._again_at:
            raise NotReady(f"the vehicle does not take velocities: {self._refusal}")

    def brake(self) -> None:
        """Stream zero velocity until the vehicle holds by itself; the caller requests the hold."""
        self._wanted = ZERO_VELOCITY
        self._forget_start()
        if self.phase is not IDLE:
            self._again_at = self._vehicle.now() + _AGAIN
            self._to(BRAKING)

    def end_stream(self, flavour: Flavour, mode: str) -> None:
        """End the stream for a command that leads to ``mode``; at once if that mode accepts setpoints."""
        if mode == flavour.external:
            self.end()
        else:
            self.brake()

    def end(self) -> None:
        """End the stream at once: the authority over the vehicle is lost."""
        self._wanted = ZERO_VELOCITY
        self._forget_start()
        self._to(IDLE)

    def _forget_start(self) -> None:
        """Cancel the request for the mode that accepts setpoints."""
        if self.phase is STARTING and self._task is not None:
            self._task.cancel()

    def tick(self) -> None:
        """Send one setpoint, and change the phase when it is due; raises LinkLost."""
        if self.halted:
            self.halted = False
            self.brake()
        flavour = self._vehicle.flavour
        if flavour is None or not self._vehicle.state.armed or not self._is_ours():
            if self.phase is not IDLE:
                self.end()
            return
        mode = flavour.mode_of(self._vehicle.state)
        if self.phase is IDLE and mode == flavour.external != flavour.goto:
            self._to(BRAKING)  # the vehicle waits for setpoints after a superseded start
            if self._authority.requested_before(mode):  # or it is shown late, and has been left since
                self._again_at = self._vehicle.now() + _LATE
        if self.phase is not IDLE:
            self._stream(flavour, self._vehicle.now())
            _STEPS[self.phase](self, flavour, mode)

    def _is_ours(self) -> bool:
        """Return True if setpoints may be sent."""
        return self._vehicle.connected and not self._vehicle.clashing and not self._authority.lost_to

    def _stream(self, flavour: Flavour | None, now: float) -> None:
        """Send the requested velocity, or zero while braking.

        It is also sent before the mode is shown: the vehicle follows as soon as it accepts setpoints, and the
        heartbeat that shows the mode arrives up to a second later.
        """
        state = self._vehicle.state
        moves = self.phase is not BRAKING and state.knows_where(now)
        if moves and flavour is not None and state.attitude is not None:
            velocity = _below(self._wanted, self._ceiling, state.relative_altitude)
            self._vehicle.send(flavour.setpoint(velocity, state.attitude.yaw, self._vehicle.system))
        else:
            self._vehicle.send(ned_setpoint(Vector3(), 0.0, self._vehicle.system))

    def _starting(self, flavour: Flavour, mode: str) -> None:
        """Request the mode once the vehicle has received enough setpoints; drive when it is shown."""
        if mode == flavour.external and not self._must_request:
            self._to(DRIVING)
        elif self._refusal is not None and self._vehicle.now() < self._again_at:
            self._to(IDLE)
        elif self._vehicle.now() - self._since_phase >= flavour.lead_in:
            self._request(self._enter_external)

    async def _enter_external(self) -> None:
        """Change to the mode that accepts setpoints; from then on the shown mode is valid."""
        await self._enter()
        self._must_request = False

    def _driving(self, flavour: Flavour, mode: str) -> None:
        """Brake after a rest; stop streaming if another command has changed the mode."""
        if mode != flavour.external:
            self._to(IDLE)
        elif self._wanted.is_zero and self._vehicle.now() - self._since >= flavour.rest:
            self._to(BRAKING)

    def _braking(self, flavour: Flavour, mode: str) -> None:
        """Continue until the mode is left; then stop streaming, or start again for a new velocity."""
        if mode != flavour.external:
            self._to(IDLE if self._wanted.is_zero else STARTING)
        elif not self._busy():
            self._request(self._hold)

    def _request(self, what: Callable[[], Awaitable[None]]) -> None:
        """Run a request in the background, one at a time, with a pause after a failure."""
        if self._task is None and self._vehicle.now() >= self._again_at:
            self._task = self._spawn(self._done(what))

    async def _done(self, what: Callable[[], Awaitable[None]]) -> None:
        """Run it, and keep its refusal for the next drive."""
        try:
            await what()
            self._refusal = None
        except Superseded as error:
            self._vehicle.log.debug("%s", error)  # not a refusal by the vehicle
        except FleetError as error:
            self._vehicle.log.warning("%s", error)
            self._refusal = error
            self._again_at = self._vehicle.now() + _AGAIN
        finally:
            self._task = None

    def _to(self, phase: StreamPhase) -> None:
        """Change the phase."""
        self.phase = phase
        self._since_phase = self._vehicle.now()


_STEPS: dict[StreamPhase, Callable[[VelocityStream, Flavour, str], None]] = {
    STARTING: VelocityStream._starting,  # noqa: SLF001
    DRIVING: VelocityStream._driving,  # noqa: SLF001
    BRAKING: VelocityStream._braking,  # noqa: SLF001
}


def _below(velocity: Velocity, ceiling: float, altitude: float | None) -> Velocity:
    """Return the velocity without its climb, at the ceiling or with an unknown altitude."""
    if velocity.linear.z <= 0 or (altitude is not None and altitude < ceiling):
        return velocity
    return Velocity(Vector3(velocity.linear.x, velocity.linear.y, 0.0), velocity.yaw_rate)
