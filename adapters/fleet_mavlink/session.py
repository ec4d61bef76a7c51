"""One robot's time on an open link: what is known of its vehicle, and everything that acts on it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable

from fleet import GeoOrigin, Health, Level, Limits, LinkLost, Robot, Vector3
from fleet_mavlink.authority import Authority
from fleet_mavlink.commander import Commander, Timing
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.driving import PERIOD, Driver
from fleet_mavlink.failsafes import Failsafes
from fleet_mavlink.fence import FenceKeeper
from fleet_mavlink.flavour import Flavour, ned_setpoint
from fleet_mavlink.flight import Flight, is_standing
from fleet_mavlink.frames import origin_of
from fleet_mavlink.hub import Hub
from fleet_mavlink.messages import Message
from fleet_mavlink.mission import Missions
from fleet_mavlink.navigation import Navigator
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.plans import Plans
from fleet_mavlink.reporter import Reporter
from fleet_mavlink.state import SILENCE
from fleet_mavlink.streams import Streams
from fleet_mavlink.texts import Sentence
from fleet_mavlink.vehicle import Vehicle

GENTLE = "stop"  # the reason of a plain stop, which ends a burst of velocities
_STANDS_WITHIN = 3.0  # s
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
        self.authority = Authority(self._authority_lost)
        self.commander = Commander(vehicle, Timing())
        self.flight = Flight(vehicle, self.commander, self.authority, limits, self._give_way)
        self.driver = Driver(
            vehicle,
            self.authority,
            ceiling=self.flight.ceiling,
            enter=self.flight.enter_external,
            hold=self.flight.hold,
            spawn=self._spawn,
        )
        self.navigator = Navigator(self.flight, limits)
        self.plans = Plans(vehicle)
        self.parameters = Parameters(vehicle, lambda: self.flight.flavour)
        self.missions = Missions(self.flight, self.plans, limits, self._give_way)
        self.fence = config.fence and FenceKeeper(
            vehicle,
            self.plans,
            self.parameters,
            fence=config.fence,
            limits=limits,
            origin=self.origin,
            changed=self._look,
        )
        self.streams = Streams(vehicle, self.commander, config.rates.pose)
        self.failsafes = Failsafes(
            vehicle,
            self.parameters,
            keeping=config.keeping,
            link_loss=config.link_loss,
            station=config.own_system,
            changed=self._look,
        )
        self._reporter = Reporter(vehicle, config.rates, robot, self.origin)
        vehicle.on_heartbeat = self._heartbeat
        vehicle.on_sentence = self._sentence

    def origin(self) -> GeoOrigin | None:
        """Return the world's origin: the one of fleet.yaml, else home; None while that is unknown."""
        given = self._config.origin
        if given is None:
            return origin_of(self.vehicle.state)
        return GeoOrigin(given.latitude, given.longitude, given.altitude, given.heading)

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

    async def stop(self, reason: str, *, takes_over: bool) -> None:
        """Brake and hold; returns once the hold is shown. On the ground there is nothing to do.

        The plain stop of a drive returns once the vehicle stands; the hold follows a moment later. A vehicle
        that somebody else has is left to him unless ``takes_over``: the plain stop at the end of a drive must
        not take it from its pilot.
        """
        if reason == GENTLE and self.driver.rest():
            await self.vehicle.until(is_standing, _STANDS_WITHIN)
            return
        self.commander.supersede(reason)
        self.driver.brake()
        if self.authority.lost_to and not takes_over:
            return
        if self.vehicle.connected and self.vehicle.state.armed and self.vehicle.flavour is not None:
            await self.flight.hold()

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
        self._hub.send_from_any_thread(messages, self.vehicle.address)

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
        system = self.vehicle.system
        if not self.vehicle.connected:
            others = [str(each) for each in self._hub.heard if each != system]
            hint = f"; systems {', '.join(others)} are heard: see system_id" if others else ""
            where = f"system {system} on {self._hub.link.url}"
            if self.vehicle.state.heartbeat is None:
                return Health(Level.OFFLINE, f"no heartbeat from {where} yet{hint}")
            return Health(Level.OFFLINE, f"no heartbeat from {where} for {SILENCE:g} s{hint}")
        if self.vehicle.clashing:
            return Health(Level.FAULT, f"two vehicles use system id {system}: give each its own")
        if self.vehicle.flavour is None:
            return Health(Level.FAULT, f"system {system} is no multirotor on ArduPilot or PX4")
        return self._well_being()

    def _well_being(self) -> Health:
        """Return how a vehicle is that answers and can be flown."""
        if self.vehicle.state.failsafe:
            return Health(Level.DEGRADED, "the autopilot is in a fail-safe")
        troubles = self.failsafes.troubles + (self.fence.troubles if self.fence else ())
        return Health(Level.DEGRADED, "; ".join(troubles)) if troubles else Health()

    def _heartbeat(self) -> None:
        """Look whether somebody else changed the mode, and whether the vehicle is back."""
        if self.vehicle.flavour is not None:
            self.authority.observe(self.vehicle.state, self.vehicle.flavour)
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
