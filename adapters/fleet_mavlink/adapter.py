"""The MAVLink adapter: the host's contract on top of a session with one vehicle."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from typing import Annotated, Any, ClassVar

from fleet import (
    FlyMission,
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
from fleet_mavlink.flight_commands import FlightCommands
from fleet_mavlink.link_hub import LinkHub, open_hub
from fleet_mavlink.maintenance import UpkeepCommands
from fleet_mavlink.payload import PayloadCommands
from fleet_mavlink.preconditions import home_unknown, require_connection, require_has
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


def _simulation(config: MavlinkConfig, start: SimulationStart) -> Simulation:
    """Return the simulated vehicle of a rehearsal; raises Refused."""
    from fleet_mavlink.sim.rehearsed import simulated_vehicle  # noqa: PLC0415 - it is slow to import

    return simulated_vehicle(config, start)


def _replayed(config: Any, robot: Robot) -> MavlinkAdapter:
    """Return the adapter itself for a replay, reaching nothing but its link."""
    return MavlinkAdapter(config.model_copy(update={"watchers": (), "traffic": "off"}), robot)


class MavlinkAdapter(StopCommands, FlightCommands, PayloadCommands, TransitionCommands, UpkeepCommands):
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

    # -- motors, home, stored mission, fail-safes, battery -------------------------------------------

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
