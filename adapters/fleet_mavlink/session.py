"""One robot's time on an open link: what is known of its vehicle, and everything that acts on it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable

from fleet import GeoOrigin, Health, Level, Limits, LinkLost, Refused, Robot, Unsupported, Vector3
from fleet_mavlink.authority import Authority
from fleet_mavlink.camera import Camera
from fleet_mavlink.commander import Commander, Timing
from fleet_mavlink.compass import Compass
from fleet_mavlink.config import MavlinkConfig, Timeouts
from fleet_mavlink.driving import PERIOD, Driver
from fleet_mavlink.failsafes import Failsafes
from fleet_mavlink.fence import FenceKeeper
from fleet_mavlink.flavour import Flavour, ned_setpoint
from fleet_mavlink.flight import Flight, is_standing
from fleet_mavlink.frames import origin_of
from fleet_mavlink.gimbal import Gimbal
from fleet_mavlink.hub import Hub
from fleet_mavlink.logs import Logs
from fleet_mavlink.messages import Message
from fleet_mavlink.mission import Missions
from fleet_mavlink.navigation import Navigator
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.payload_messages import SetupSigning
from fleet_mavlink.plans import Plans
from fleet_mavlink.reporter import Reporter
from fleet_mavlink.require import require_connection
from fleet_mavlink.state import SILENCE, VehicleState
from fleet_mavlink.streams import Streams
from fleet_mavlink.takeoff import TakeOff
from fleet_mavlink.texts import Sentence, alarm
from fleet_mavlink.trust import FALSE, UNSIGNED
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.words import AUTOPILOT

GENTLE = "stop"  # the reason of a plain stop, which ends a burst of velocities
_STANDS_WITHIN = 3.0  # s
_KEY_TOLD = 3  # times; nothing answers
_SIGNS_WITHIN = 2.0  # s
_LOOK = 0.25  # s between looks at the vehicle's health


class Session:
    """A vehicle, and what flies, drives, watches and reports it; ``limits`` are those in force."""

    def __init__(
        self, config: MavlinkConfig, limits: Limits, hub: Hub, vehicle: Vehicle, robot: Robot
    ) -> None:
        self.vehicle = vehicle
        self._config = config
        self._hub = hub
        self._robot = robot
        self._began = robot.clock.monotonic()
        self._tasks: set[asyncio.Task[None]] = set()
        self._alarm = ""  # what the autopilot said of the fail-safe that it is in
        self.authority = Authority(self._authority_lost)
        self.commander = Commander(vehicle, _timing(config.timeouts))
        self.flight = Flight(vehicle, self.commander, self.authority, limits, self._give_way)
        self.driver = Driver(
            vehicle,
            self.authority,
            ceiling=self.flight.ceiling,
            enter=self.flight.enter_external,
            hold=self.flight.hold,
            spawn=self._spawn,
            busy=self.commander.turn.locked,
        )
        self.parameters = Parameters(vehicle, lambda: self.flight.flavour)
        self.takeoff = TakeOff(self.flight, self.parameters)
        self.navigator = Navigator(self.flight, self.takeoff, limits)
        self.plans = Plans(vehicle)
        self.missions = Missions(self.flight, self.takeoff, self.plans, limits)
        self.fence = config.fence and FenceKeeper(
            vehicle,
            self.plans,
            self.parameters,
            fence=config.fence,
            limits=limits,
            origin=self.origin,
            changed=self._look,
        )
        self.failsafes = Failsafes(
            vehicle,
            self.parameters,
            keeping=config.keeping,
            link_loss=config.link_loss,
            station=config.own_system,
            lasting=not config.simulated,
            changed=self._look,
        )
        self.logs = Logs(vehicle)
        self.compass = Compass(self.flight)
        station = (config.own_system, config.own_component)
        self.gimbal = Gimbal(vehicle, self.commander, station, self._spawn)
        self.camera = Camera(vehicle, self.commander.timing)
        motors = config.rates.motors if config.motor_joints else 0.0
        self.streams = Streams(
            vehicle, self.commander, config.rates.pose, imu=config.rates.imu, motors=motors
        )
        self._reporter = Reporter(vehicle, config, robot, self.origin, self.counts)
        vehicle.log = robot.log
        vehicle.on_heartbeat = self._heartbeat
        vehicle.on_sentence = self._sentence

    def origin(self) -> GeoOrigin | None:
        """Return the world's origin: the one of fleet.yaml, else home; None while that is unknown."""
        given = self._config.origin
        if given is None:
            return origin_of(self.vehicle.state)
        return GeoOrigin(given.latitude, given.longitude, given.altitude, given.heading)

    def counts(self) -> dict[str, int]:
        """Return what was refused, or did not fit, on the way from the vehicle, by what it was."""
        return dict(self.vehicle.trust.counts) | {
            "frames with a wrong checksum on its link": self._hub.broken
        }

    async def serve(self, *losses: Awaitable[None]) -> None:
        """Serve until one of ``losses`` raises, which is raised here."""
        self._robot.every(PERIOD, self._tick)
        self._robot.every(_LOOK, self._look)
        self._reporter.begin()
        keepers = [self.streams.keep(), self.failsafes.keep()]
        if self.fence:
            keepers.append(self.fence.keep())
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
        """True while the autopilot shows that it lands, or returns home; from any thread."""
        state, flavour = self.vehicle.state, self.vehicle.flavour
        return flavour is not None and flavour.mode_of(state) in {flavour.land, flavour.return_home}

    async def stop(self, reason: str, *, takes_over: bool) -> None:
        """Brake and hold; returns once the hold is shown. On the ground there is nothing to do.

        The plain stop of a drive returns once the vehicle stands; the hold follows a moment later, or at once
        when it does not. A vehicle that somebody else has is left to him unless ``takes_over``: the plain
        stop at the end of a drive must not take it from its pilot.
        """
        if reason == GENTLE and self.driver.rest() and await self._rests():
            return
        self.commander.supersede(reason)
        self.driver.brake()
        if self.authority.lost_to and not takes_over:
            return
        if self.vehicle.connected and self.vehicle.state.armed and self.vehicle.flavour is not None:
            await self.flight.hold()

    async def _rests(self) -> bool:
        """Wait until the vehicle stands; False when it takes no setpoints, or does not stand in time."""

        def settled(state: VehicleState) -> bool:
            return is_standing(state) or not self.driver.drives

        await self.vehicle.until(settled, _STANDS_WITHIN)
        return is_standing(self.vehicle.state)

    async def kill(self) -> None:
        """Stop the motors at once; whatever is under way ends, and nothing more is streamed."""
        self.commander.supersede("kill")
        self.driver.end()
        await self.flight.kill()

    def halt(self) -> None:
        """Write what stops the vehicle now; from any thread. The next tick goes on from there.

        A vehicle that does not answer may be following its own fail-safe: its mode is not touched.
        """
        state, flavour = self.vehicle.state, self.vehicle.flavour
        self.driver.halted = True
        if flavour is None or not state.armed or self.authority.lost_to:
            return
        messages: list[Message] = []
        if flavour.mode_of(state) == flavour.external:
            messages.append(ned_setpoint(Vector3(), 0.0, self.vehicle.system))
        # Zero alone is not enough: PX4 descends when the setpoints of a stuck process end.
        if self.vehicle.connected:
            self.authority.expect(flavour.hold)
            messages.append(self.commander.addressed(flavour.hold_command()))
        self._hub.send_from_any_thread(messages, self.vehicle)

    async def setup_signing(self) -> None:
        """Give the vehicle our key; returns once it signs with it. Raises Unsupported when it does not."""
        require_connection(self.vehicle)
        trust = self.vehicle.trust
        if trust.signer is None:
            raise Refused("there is no key", hint="give this robot a signing_key in fleet.yaml")
        if self.vehicle.state.armed:
            raise Refused("it is armed; a key is set up on the ground", hint="disarm first")
        for _ in range(_KEY_TOLD):
            key, stamp = tuple(trust.signer.key), trust.signer.stamp()
            self.vehicle.send(SetupSigning(self.vehicle.system, AUTOPILOT, key, stamp))
            if await self.vehicle.until(lambda _: trust.signed, _SIGNS_WITHIN):
                return
        raise Unsupported("it does not sign", hint="PX4 1.16 cannot; ArduPilot can")

    def report_battery(self) -> bool:
        """Report the battery now; False while it is unknown."""
        return self._reporter.battery()

    def _give_way(self, flavour: Flavour, mode: str) -> None:
        """End the stream of setpoints before a command that leads to ``mode``."""
        self.driver.give_way(flavour, mode)

    def _tick(self) -> None:
        """Stream setpoints; a link that fell is noticed by who waits for it."""
        try:
            self.driver.tick()
        except LinkLost as error:
            self._robot.log.debug("no setpoint was sent: %s", error)

    def _look(self) -> None:
        """Say how the way to the vehicle is."""
        self.vehicle.tick()
        never_heard = self.vehicle.state.heartbeat is None
        if never_heard and self._robot.clock.monotonic() - self._began < SILENCE:
            return  # it was given no time to speak yet
        self._robot.health(self._health())

    def _health(self) -> Health:
        """Return how the vehicle is, with the cause."""
        vehicle = self.vehicle
        if not vehicle.connected:
            return Health(Level.OFFLINE, self._absence())
        if vehicle.clashing:
            return Health(Level.FAULT, f"two vehicles use system id {vehicle.system}: give each its own")
        if vehicle.flavour is None:
            return Health(Level.FAULT, f"system {vehicle.system} is no multirotor on ArduPilot or PX4")
        troubles = self._troubles()
        return Health(Level.DEGRADED, "; ".join(troubles)) if troubles else Health()

    def _troubles(self) -> tuple[str, ...]:
        """Return what is wrong with a vehicle that answers and can be flown."""
        vehicle = self.vehicle
        if vehicle.state.failsafe:
            return (f"the autopilot is in a fail-safe{': ' if self._alarm else ''}{self._alarm}",)
        troubles = self.failsafes.troubles + (self.fence.troubles if self.fence else ())
        if vehicle.trust.signer is not None and not vehicle.trust.signed:
            return (f"system {vehicle.system} does not sign: send setup_signing", *troubles)
        return troubles

    def _absence(self) -> str:
        """Say what is not heard, and what is heard instead."""
        system = self.vehicle.system
        where = f"system {system} on {self._hub.link.url}"
        others = [str(each) for each in self._hub.unclaimed]
        hint = f"; systems {', '.join(others)} are heard: see system_id" if others else ""
        if self.vehicle.state.heartbeat is not None:
            return f"no heartbeat from {where} for {SILENCE:g} s{hint}"
        refused = [why for why in (UNSIGNED, FALSE) if self.vehicle.trust.counts[why]]
        if refused:
            return f"{where} sends {refused[0]}: see signing_key, accept_unsigned"
        return f"no heartbeat from {where} yet{hint}"

    def _heartbeat(self) -> None:
        """Look whether somebody else changed the mode, and whether the vehicle is back."""
        vehicle = self.vehicle
        if not vehicle.state.failsafe:
            self._alarm = ""
        elif not self._alarm:
            self._alarm = alarm(vehicle.sentences, vehicle.now())
        if vehicle.flavour is not None:
            self.authority.observe(vehicle.state, vehicle.flavour, self._alarm)
        self._robot.health(self._health())

    def _authority_lost(self, reason: str) -> None:
        """End everything of ours; what is being asked is not asked again over a pilot's head."""
        self.commander.supersede("somebody else has the vehicle")
        self.driver.end()
        self._robot.authority_lost(reason)

    def _sentence(self, sentence: Sentence) -> None:
        """Pass on what the autopilot says."""
        self._reporter.said(sentence)

    def _spawn(self, work: Awaitable[None]) -> asyncio.Task[None]:
        """Run something in the background for as long as the session lasts."""
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task


def _timing(timeouts: Timeouts) -> Timing:
    """Return how long commands wait, as the config says."""
    return Timing(answer=timeouts.answer, tries=timeouts.tries, working=timeouts.working)
