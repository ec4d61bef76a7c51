"""A simulated vehicle behind the host: requests go through the controller, as a person's do."""

import asyncio
import contextlib

from fleet.host.requests.receipt import Receipt
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.event import EventReport
from fleet.model.geometry import Vector3, Velocity
from fleet.model.navigation import Navigate
from fleet.testing.clock import LoopClock
from fleet_mavlink.adapter import MavlinkAdapter
from tests.adapters.fleet_mavlink.conftest import SimFlight
from tests.fleet.host.field import local_robot

TELE = Origin(Transport.BUS, "tele", "anna")
TICK = 0.02  # s between the checks of the dead-man


class HostedRequest:
    """One request, and its answers; ``receipt`` is the first, ``end`` the last."""

    def __init__(self, name):
        self.name = name
        self.answers = []

    @property
    def receipt(self):
        return self.answers[0] if self.answers else None

    @property
    def end(self):
        """The final answer; None while it is under way."""
        last = self.answers[-1] if self.answers else None
        return last if last is not None and (last.done is not None or not last.ok) else None

    @property
    def reason(self):
        return self.end.reason if self.end is not None else ""

    def __str__(self):
        if self.end is None:
            return f"{self.name}: under way"
        return f"{self.name}: {self.end.outcome}"


class HostedSky(SimFlight):
    """A simulated vehicle that the host moves; ``request`` and its kin return the request."""

    def __init__(self, flavour, *, vehicle="multirotor", **more):
        super().__init__(flavour, vehicle=vehicle, **more)
        self.drives = vehicle == "rover"

    async def __aenter__(self):
        loop = asyncio.get_running_loop()
        self.clock = LoopClock(loop)
        self.scheduler = TickScheduler(loop, self.clock)
        self.reports, self.events = [], []
        self._origin = self.clock.monotonic()
        self._ids = 0
        self._peer.__enter__()
        self.robot = local_robot(
            self.config,
            self._kind(),
            clock=self.clock,
            scheduler=self.scheduler,
            tell=self.reports.append,
        )
        self.scheduler.start()
        self.run = self.robot.start()
        self._turning = asyncio.ensure_future(self._turn())
        self._watching = asyncio.ensure_future(self._watch())
        return self

    async def __aexit__(self, *_):
        for task in (self.run, self._watching):
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        self._turning.cancel()
        await asyncio.gather(self._turning, return_exceptions=True)
        self.scheduler.stop()
        self._peer.__exit__(None, None, None)

    def _kind(self):
        """Return the adapter's class, whose newest instance is ``adapter``."""
        sim_flight = self

        class Made(MavlinkAdapter):
            def __init__(self, config, robot):
                super().__init__(config, robot)
                sim_flight.adapter = self

        return Made

    async def _watch(self):
        """End velocities whose lease has expired, as the watchdog's thread does."""
        controller = self.robot.controller
        while True:
            if controller.deadman.expire(self.clock.monotonic()):
                controller.halt()
                controller.motion.lease_ran_out()
            await asyncio.sleep(TICK)

    @property
    def now(self):
        return self.clock.monotonic() - self._origin

    @property
    def losses(self):
        """Return how control was lost, by the host's events."""
        return [
            each.text for each in self.reports if isinstance(each, EventReport) and "authority" in each.text
        ]

    @property
    def adapter_known(self):
        return getattr(self, "adapter", None) is not None and hasattr(self.adapter, "_session")

    async def wait_until_known(self):
        """Let time pass until the host knows the vehicle and where it is."""
        await self.until(
            lambda: (
                self.adapter_known
                and not self.robot.controller.offline
                and self.state.home_altitude is not None
            )
        )
        await asyncio.sleep(2.0)  # the host hears of its home once a second
        return self

    def _take(self, what, name):
        requested = HostedRequest(name)
        self.robot.controller.receive(what, Receipt(name, requested.answers.append, waits=True))
        return requested

    def request(self, name, /, **data):
        """Send a command."""
        self._ids += 1
        return self._take(Command(name, data, TELE, f"c{self._ids}"), name)

    def go(self, task):
        """Send a goal, or a control of the running action."""
        self._ids += 1
        return self._take(Navigate(task, f"a{self._ids}", TELE), type(task).__name__)

    def hold(self, x=0.0, y=0.0, z=0.0):
        """Send one velocity."""
        return self._take(Setpoint(Velocity(Vector3(x, y, z)), origin=TELE), "velocity")

    async def done(self, requested, within=120.0):
        """Let time pass until a request has its final answer."""
        await self.until(lambda: requested.end is not None, within)
        return requested

    async def does(self, name, /, **data):
        """Send a command and see it done."""
        requested = await self.done(self.request(name, **data), within=400.0)
        assert requested.end.done, f"{requested}"
        return requested

    @contextlib.asynccontextmanager
    async def driven(self, seconds=1.0, **velocity):
        """Hold a velocity at 10 Hz; yields the answers."""
        requested = []

        async def drive():
            for _ in range(round(seconds / 0.1)):
                requested.append(self.hold(**velocity))
                await asyncio.sleep(0.1)

        task = asyncio.ensure_future(drive())
        try:
            yield requested
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
