"""The MAVLink adapter: the host's contract on top of a session with one vehicle."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from typing import Annotated, Any, ClassVar

from fleet import (
    FlyMission,
    GeoPoint,
    Health,
    Level,
    Limits,
    NotReady,
    Progress,
    Range,
    Refused,
    Robot,
    Separation,
    Simulation,
    SimulationStart,
    Task,
    Velocity,
    command,
)
from fleet.sim.process import SimProcess
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.constants import Landed
from fleet_mavlink.link_hub import LinkHub, open_hub
from fleet_mavlink.maintenance import UpkeepCommands
from fleet_mavlink.payload import PayloadCommands
from fleet_mavlink.preconditions import home_unknown, not_in_the_air, require_connection, require_has
from fleet_mavlink.redaction import SigningKeyRedaction
from fleet_mavlink.session import VehicleSession
from fleet_mavlink.signing import Signer, key_of
from fleet_mavlink.sim.spec import VehicleSpec
from fleet_mavlink.stops import StopCommands
from fleet_mavlink.traffic import report_traffic
from fleet_mavlink.transition import TransitionCommands
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.watching import show

_SIMULATOR = "fleet_mavlink.sim"
_Distance = Annotated[float, Range(-1000.0, 1000.0, "m")]  # the word says up or down, whatever the sign
_Height = Annotated[float, Range(0.0, 10_000.0, "m above home")]  # the vehicle's ceiling is lower


def _simulation(config: MavlinkConfig, start: SimulationStart) -> Simulation:
    """Return the simulated vehicle of a rehearsal; raises Refused."""
    from fleet_mavlink.sim.rehearsed import simulated_vehicle  # noqa: PLC0415 - it is slow to import

    return simulated_vehicle(config, start)


def _replayed(config: Any, robot: Robot) -> MavlinkAdapter:
    """Return the adapter itself for a replay, reaching nothing but its link."""
    return MavlinkAdapter(config.model_copy(update={"watchers": (), "traffic": "off"}), robot)


class MavlinkAdapter(StopCommands, PayloadCommands, TransitionCommands, UpkeepCommands):
    """A multirotor, plane or VTOL on ArduPilot or PX4, or a rover or boat on ArduPilot.

    Which of them it is decides what it takes of the vocabulary (``vocabulary``), and nothing else for who
    commands it. Other vehicles are watched and stopped.
    """

    Config = MavlinkConfig
    holonomic: ClassVar[bool] = True
    limits: ClassVar[Limits] = Limits(speed=5.0, vertical_speed=2.0, yaw_rate=1.0, altitude=120.0)
    tells_home = True
    failsafe = "the autopilot holds 1 to 3 s after the last velocity (docs/how-to/drone-safety.md)"
    separation: ClassVar[Separation] = Separation(radius=1.5, braking=1.5, precedence=3)

    simulation = staticmethod(_simulation)
    redaction = staticmethod(SigningKeyRedaction)
    replayed = staticmethod(_replayed)

    _hub: LinkHub
    _sim: SimProcess | None = None  # of a simulated vehicle

    async def connect(self) -> None:
        """Open the link, or share it; raises LinkLost or LinkRefused."""
        config, robot = self.config, self.robot
        where = f"system {config.system_id} on {config.link}"
        robot.health(Health(Level.OFFLINE, f"no heartbeat from {where} yet"))
        urls = [config.link, *config.backup_links]
        if config.simulated:
            self._sim = await robot.enter(robot.share(_SIMULATOR, lambda: SimProcess(_SIMULATOR)))
            spec = VehicleSpec.parse(config.link, system_id=config.system_id)
            urls[0] = await robot.enter(self._sim.robot(spec))
        key = f"mavlink {' '.join(urls)} {config.own_system}/{config.own_component}"
        self._hub = await robot.enter(
            robot.share(key, lambda: open_hub(urls, robot.clock, config.own_system, config.own_component))
        )
        vehicle = await robot.enter(self._claim())
        self._session = VehicleSession(config, robot.limits, self._hub, vehicle, robot)
        await show(config, robot, self._hub, self._session)
        await report_traffic(config, robot, vehicle)

    @contextlib.asynccontextmanager
    async def _claim(self) -> AsyncIterator[Vehicle]:
        """Give the vehicle of this robot; raises LinkRefused when another robot has it."""
        config = self.config
        key = config.signing_key
        signer = Signer(key_of(key.get_secret_value()), self.robot.clock.time) if key else None
        with self._hub.vehicle(config.system_id, signer, accept_unsigned=config.accept_unsigned) as vehicle:
            yield vehicle

    async def run(self) -> None:
        """Serve the vehicle; raises LinkLost or LinkRefused."""
        losses = [self._hub.link.lost()]
        if self._sim is not None:
            losses.append(self._sim.lost())
        await self._session.serve(*losses)

    def drive(self, velocity: Velocity) -> None:
        """Stream this body velocity; raises NotReady or Refused when the vehicle cannot be driven."""
        self._session.driver.drive(velocity)

    async def navigate(self, task: Task) -> AsyncIterator[Progress]:
        """Fly a task with the autopilot's own position control."""
        session = self._session
        origin = session.origin()
        if origin is None:
            raise home_unknown()
        if isinstance(task, FlyMission):
            steps = session.missions.fly(task)
        else:
            steps = session.navigator.carry_out(task, origin)
        async for progress in steps:
            yield progress

    # -- flying and driving --------------------------------------------------------------------------

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

    @command("arm", interrupts=False)
    async def arm(self, *, force: bool = False) -> None:
        """Start the motors, in a mode that can be moved in."""
        await self._session.flight.arming.arm(force=force)

    @command("disarm", in_place=True)
    async def disarm(self, *, force: bool = False) -> None:
        """Stop the motors; refused in the air and while it drives, whatever ``force`` says."""
        await self._session.flight.arming.disarm(force=force)

    @command("kill", moves=False, safe=True)  # so that nothing is waited for before it
    async def kill(self, *, force: bool = False) -> None:
        """Stop the motors at once, in the air too: it falls. Takes ``force``, and a config that allows it."""
        if not self.config.allow_kill:
            raise Refused(
                "kill is not allowed for this robot", hint="allow_kill: true in fleet.yaml allows it"
            )
        if not force:
            raise Refused("kill stops the motors: in the air it falls", hint="say force=true")
        await self._session.kill()

    @command("set_home_here", moves=False)
    async def set_home_here(self) -> None:
        """Make this place home."""
        await self._session.flight.home.set_here()

    @command("clear_mission", moves=False)
    async def clear_mission(self) -> None:
        """Make the autopilot forget the mission in its memory."""
        await self._session.missions.clear()

    @command("set_failsafes", moves=False, timeout=60.0)
    async def set_failsafes(self) -> None:
        """Write the fail-safe parameters that fleet.yaml asks for; refused while the motors run."""
        require_has(self._session.vehicle, "set_failsafes")
        await self._session.failsafes.set()

    @command("set_home_location", moves=False)
    async def set_home_location(
        self,
        *,
        latitude: Annotated[float, Range(-90, 90, "degrees")],
        longitude: Annotated[float, Range(-180, 180, "degrees")],
        altitude: Annotated[float, Range(-500, 10_000, "m above mean sea level")] | None = None,
    ) -> None:
        """Make a place home (degrees; m above mean sea level, left out: as high as home is now)."""
        await self._session.flight.home.set_to(latitude, longitude, altitude)

    @command("battery_check", moves=False, safe=True)
    async def battery_check(self) -> None:
        """Report the battery now."""
        session = self._session
        require_connection(session.vehicle)
        if not session.report_battery():
            raise NotReady("the vehicle has not said how its battery is")

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
