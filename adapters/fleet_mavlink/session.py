"""Session with one vehicle on an open link: its state, and all parts that act on it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Mapping

from fleet import (
    CommandError,
    GeoOrigin,
    Limits,
    LinkLost,
    NotReady,
    Refused,
    Robot,
    Unsupported,
)
from fleet_mavlink.authority import Authority
from fleet_mavlink.braking import Brakes
from fleet_mavlink.camera import CameraComponent
from fleet_mavlink.command_queue import Superseded
from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.compass import Compass
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.constants import AUTOPILOT
from fleet_mavlink.event_metadata import EventKeeper
from fleet_mavlink.failsafes import Failsafes
from fleet_mavlink.fence import FenceUploader
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.flight import Flight
from fleet_mavlink.gimbal import Gimbal
from fleet_mavlink.halts import Halts, require_ours
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.logs import LogReader
from fleet_mavlink.message_rates import MessageRates
from fleet_mavlink.mission import MissionExecutor
from fleet_mavlink.navigation import AutopilotNavigator
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.payload_messages import SetupSigning
from fleet_mavlink.plans import Plans
from fleet_mavlink.preconditions import is_standing, require_connection
from fleet_mavlink.remote_id import RemoteId
from fleet_mavlink.reporter import Reporter
from fleet_mavlink.state import VehicleState
from fleet_mavlink.steering import SteeringSettings
from fleet_mavlink.takeoff import TakeOff
from fleet_mavlink.vehicle import Vehicle, circle_of, missing_commands
from fleet_mavlink.vehicle_health import VehicleHealth
from fleet_mavlink.velocity_stream import PERIOD, VelocityStream
from fleet_mavlink.wing_settings import WingSettings
from fleet_mavlink.world_frame import origin_of

GENTLE = "stop"  # the reason of a plain stop, which ends a burst of velocities
_STANDS_WITHIN = 3.0  # s
_KEY_SENT = 3  # times; nothing answers
_SIGNS_WITHIN = 2.0  # s
_POLL_INTERVAL = 0.25  # s between looks at the vehicle's health


class VehicleSession:
    """A vehicle with its flight, drive, monitoring and reports; ``limits`` are the effective ones."""

    def __init__(
        self, config: MavlinkConfig, limits: Limits, hub: LinkHub, vehicle: Vehicle, robot: Robot
    ) -> None:
        self.vehicle = vehicle
        self._config = config
        self._hub, self._robot = hub, robot
        self._tasks: set[asyncio.Task[None]] = set()
        self.health = VehicleHealth(
            vehicle,
            hub,
            robot,
            lambda: (*self.failsafes.troubles, *(self.fence.troubles if self.fence else ())),
        )
        self._lacking: Mapping[str, str] | None = None  # last reported to the host in this run
        self.authority = Authority(self._authority_lost)
        waits = config.timeouts
        self.commander = Commander(vehicle, CommandTimeouts(waits.answer, waits.tries, waits.working))
        self.flight = Flight(vehicle, self.commander, self.authority, limits, self._end_stream)
        self.driver = VelocityStream(
            vehicle,
            self.authority,
            ceiling=self.flight.ceiling,
            enter=self.flight.enter_external,
            hold=self.flight.hold,
            spawn=self._spawn,
            busy=self.commander.turns.lock.locked,
        )
        self.brakes = Brakes(vehicle, self.commander)
        self.halts = Halts(
            vehicle,
            hub,
            commander=self.commander,
            authority=self.authority,
            driver=self.driver,
            brakes=self.brakes,
            comes_down=lambda: self.comes_down,
        )
        self.parameters = Parameters(vehicle, lambda: self.flight.flavour)
        self.takeoff = TakeOff(self.flight, self.parameters)
        self.navigator = AutopilotNavigator(self.flight, self.takeoff, limits)
        self.plans = Plans(vehicle)
        self.missions = MissionExecutor(self.flight, self.takeoff, self.plans, limits)
        self.fence = config.fence and FenceUploader(
            vehicle,
            self.plans,
            self.parameters,
            fence=config.fence,
            limits=limits,
            origin=self.origin,
            changed=self.health.check,
        )
        self.failsafes = Failsafes(
            vehicle,
            self.parameters,
            keeping=config.keeping,
            link_loss=config.link_loss,
            station=config.own_system,
            persistent=not config.simulated,
            changed=self.health.check,
        )
        self.logs = LogReader(vehicle)
        self.compass = Compass(self.flight)
        station = (config.own_system, config.own_component)
        self.gimbal = Gimbal(vehicle, self.commander, station, self._spawn)
        self.camera = CameraComponent(vehicle, self.commander.timing)
        motors = config.rates.motors if config.motor_joints else 0.0
        self.streams = MessageRates(
            vehicle, self.commander, config.rates.pose, imu=config.rates.imu, motors=motors
        )
        self._reporter = Reporter(vehicle, config, robot, self.origin, self.counts)
        vehicle.log = robot.log
        vehicle.on_heartbeat = self._heartbeat
        vehicle.on_sentence = self._reporter.report_text

    def origin(self) -> GeoOrigin | None:
        """Return the world's origin: the one of fleet.yaml, else home; None while that is unknown."""
        given = self._config.origin
        if given is None:
            return origin_of(self.vehicle.state)
        return GeoOrigin(given.latitude, given.longitude, given.altitude, given.heading)

    def counts(self) -> dict[str, int]:
        """Return the counts of refused and broken messages from the vehicle, by reason."""
        return dict(self.vehicle.trust.counts) | {
            "frames with a wrong checksum on its link": self._hub.broken
        }

    async def serve(self, *losses: Awaitable[None]) -> None:
        """Serve until one of ``losses`` raises, which is raised here."""
        self._robot.every(PERIOD, self._tick)
        self._robot.every(_POLL_INTERVAL, self.health.check)
        self._reporter.begin()
        remote_id = RemoteId(self.vehicle, self._config.remote_id, self._robot.clock.time)
        settings = (
            SteeringSettings(self.vehicle, self.parameters),
            WingSettings(self.vehicle, self.parameters),
        )
        parts = self.streams, self.failsafes, EventKeeper(self.vehicle), *settings, remote_id
        keepers = [part.run() for part in parts]
        if self.fence:
            keepers.append(self.fence.run())
        work = [asyncio.ensure_future(each) for each in (*losses, *keepers)]
        try:
            done, _ = await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
            for each in done:
                each.result()
        finally:
            for task in (*work, *self._tasks):
                task.cancel()
            await asyncio.gather(*work, *self._tasks, return_exceptions=True)

    @property
    def comes_down(self) -> bool:
        """True while the autopilot shows that it lands, or flies home; from any thread.

        What drives home is safer where it stands.
        """
        state, flavour = self.vehicle.state, self.vehicle.flavour
        if flavour is None or flavour.surface:
            return False
        return flavour.comes_down(state) or flavour.mode_of(state) == self.flight.descent

    @property
    def is_ours_to_stop(self) -> bool:
        """True when the host may stop the vehicle by itself: we control it, and it is not coming down."""
        flown = self.vehicle.connected and self.vehicle.flavour is not None and not self.authority.lost_to
        return flown and not self.comes_down

    async def stop(self, reason: str, *, takes_over: bool) -> None:
        """Brake and hold; returns once the hold is shown. On the ground there is nothing to do.

        The plain stop of a drive returns once the vehicle stands; the hold follows a moment later, or at once
        when it does not stand. A vehicle under another operator's control is left alone unless
        ``takes_over``, because the plain stop at the end of a drive must not take it from its pilot; raises
        Refused then. A vehicle that is not moved here is braked under any control. To a silent one the stop
        is only written; raises NotReady then: it is unknown whether it stops. A failed stop stays in health
        until one succeeds, or the motors are off.
        """
        if self.authority.lost_to and not takes_over:
            self.commander.turns.supersede(reason)
            self.driver.brake()
        require_ours(self.authority, takes_over=takes_over)
        try:
            await self._stop(reason, takes_over=takes_over)
        except Superseded:
            raise
        except CommandError as error:
            self.health.unstopped = f"it was not stopped: {error.reason}"
            self._robot.log.error("%s", self.health.unstopped)  # noqa: TRY400 - its place says nothing
            raise
        self.health.unstopped = ""

    async def _stop(self, reason: str, *, takes_over: bool) -> None:
        """Brake and hold, or raise; a silent vehicle gets the stop too."""
        if not self.vehicle.connected:
            self.halts.write(takes_over=takes_over)
            raise NotReady(
                f"no heartbeat from system {self.vehicle.system}: the stop was written, and not seen to be "
                "carried out",
                hint="check the link and its power",
            )
        if reason == GENTLE and self.driver.rest() and await self._rests():
            return
        self.commander.turns.supersede(reason)
        self.driver.brake()
        flavour = self.vehicle.flavour
        if flavour is None:
            await self.brakes.brake()
        elif flavour.surface or (flavour.tries_brakes and self.vehicle.state.armed):
            with self.authority.requesting(*flavour.brake_modes(self.vehicle.state)):
                await self.brakes.brake()
        elif self.vehicle.state.armed:
            await self.flight.hold()

    async def _rests(self) -> bool:
        """Wait until the vehicle stands; False when it takes no setpoints, or does not stand in time."""

        def settled(state: VehicleState) -> bool:
            return is_standing(state) or not self.driver.drives

        await self.vehicle.until(settled, _STANDS_WITHIN)
        return is_standing(self.vehicle.state)

    async def kill(self) -> None:
        """Stop the motors at once; end running commands and the stream of setpoints."""
        self.commander.turns.supersede("kill")
        self.driver.end()
        await self.flight.arming.kill()

    async def setup_signing(self) -> None:
        """Give the vehicle our key; returns once it signs with it. Raises Unsupported when it does not."""
        require_connection(self.vehicle)
        trust = self.vehicle.trust
        if trust.signer is None:
            raise Refused("there is no key", hint="give this robot a signing_key in fleet.yaml")
        if self.vehicle.state.armed:
            raise Refused("it is armed; a key is set up on the ground", hint="disarm first")
        for _ in range(_KEY_SENT):
            key, stamp = tuple(trust.signer.key), trust.signer.stamp()
            self.vehicle.send(SetupSigning(self.vehicle.system, AUTOPILOT, key, stamp))
            if await self.vehicle.until(lambda _: trust.signed, _SIGNS_WITHIN):
                return
        raise Unsupported("it does not sign", hint="PX4 1.16 cannot; ArduPilot can")

    def report_battery(self) -> bool:
        """Report the battery now; False while it is unknown."""
        return self._reporter.battery()

    def _end_stream(self, flavour: Flavour, mode: str) -> None:
        """End the stream of setpoints before a command that leads to ``mode``."""
        self.driver.end_stream(flavour, mode)

    def _tick(self) -> None:
        """Stream setpoints; the task that waits for the link notices when it is down.

        Where a halt ended a command, the vehicle may still have obeyed that, so the hold is made sure of.
        """
        if self.commander.turns.end_halted() and not self.comes_down:
            self._spawn(self.flight.hold_if_ours())
        try:
            self.driver.tick()
        except LinkLost as error:
            self._robot.log.debug("no setpoint was sent: %s", error)

    def _heartbeat(self) -> None:
        """Check whether another operator changed the mode, and whether the vehicle is back."""
        vehicle = self.vehicle
        self.health.find_failsafe_cause()
        lacking = missing_commands(vehicle.state)
        if lacking != self._lacking:
            self._lacking = lacking
            self._robot.lacks(lacking)
        self._robot.circles(circle_of(vehicle.state))
        if vehicle.flavour is not None:
            self.authority.observe(vehicle.state, vehicle.flavour, self.health.cause.text)
        self.health.report()

    def _authority_lost(self, reason: str) -> None:
        """End all our activity; running commands are not repeated against the pilot."""
        self.commander.turns.supersede("another operator has control of the vehicle")
        self.driver.end()
        if self.vehicle.state.failsafe and not self.health.cause.text:
            self._spawn(self._report_loss(reason))  # only the report waits for the reason
        else:
            self._robot.authority_lost(reason)

    async def _report_loss(self, reason: str) -> None:
        """Report a loss of authority, after waiting for the autopilot's reason."""
        while not self.health.cause.text and not self.health.cause.settled(self.vehicle.now()):
            await asyncio.sleep(_POLL_INTERVAL)
            self.health.find_failsafe_cause()
        why = self.health.cause.text
        self.authority.cause = why
        self._robot.authority_lost(f"{reason} ({why})" if why else reason)

    def _spawn(self, work: Awaitable[None]) -> asyncio.Task[None]:
        """Run something in the background for as long as the session lasts."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
