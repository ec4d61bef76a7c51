"""A field of simulated robots, each with its controller, in time that jumps: nothing waits."""

import asyncio
import contextlib
import uuid
from collections import deque
from typing import Literal

from fleet.adapter import Adapter, AdapterConfig
from fleet.commands import command
from fleet.config.schema import FleetConfig
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.robot_positions import positions_of
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import (
    ZERO_VELOCITY,
    Vector3,
    Velocity,
    quaternion_from_yaw,
    rotate_to_world,
)
from fleet.model.navigation import Goal, GoTo, Navigate, Progress, RelativeMove
from fleet.model.report import PoseReport
from fleet.robot_config import Limits, Separation
from fleet.supervisor.client import SupervisorClient
from fleet.testing.clock import LoopClock

STEP = 0.02  # s of physics
TELE = Origin(Transport.BUS, "tele", "anna")


class WalkerConfig(AdapterConfig):
    adapter: Literal["walker"] = "walker"
    link: str = "memory:walker"
    lag: float = 0.15  # s until it does what it is told
    poses: float = 0.1  # s between two


class Walker(Adapter[WalkerConfig]):
    """A robot that drives, and is led by the host; it gains and loses speed at 1 m/s2."""

    Config = WalkerConfig
    limits = Limits(speed=1.5, yaw_rate=2.0)
    failsafe = "it moves nothing"
    separation = Separation(radius=0.4, braking=1.0, precedence=2)
    engage = 1.0  # m/s2

    def __init__(self, config, robot):
        super().__init__(config, robot)
        x, y, yaw = config.start or (0.0, 0.0, 0.0)
        self.site = Vector3(x, y)  # where it truly is, in the site's frame
        self.world = Vector3()
        self.turn = yaw
        self.yaw = 0.0
        self.velocity = Vector3()  # m/s in its own world
        self.requested = ZERO_VELOCITY
        self.silent = False
        self.stops = 0
        self._orders = deque()  # told, and not obeyed yet

    async def connect(self):
        self.loop = asyncio.get_running_loop()
        self.robot.every(STEP, self._step)
        self.robot.every(self.config.poses, self._tell)

    def _tell(self):
        if not self.silent:
            now = self.robot.clock.time()
            self.robot.report(PoseReport(now, self.world, quaternion_from_yaw(self.yaw)))

    def _wanted(self):
        return rotate_to_world(self.requested.linear, self.yaw)

    def _step(self):
        change = self._wanted() - self.velocity
        most = self.engage * STEP
        if change.norm() > most:
            change = change.scaled(most / change.norm())
        self.velocity = self.velocity + change
        self.yaw += self.requested.yaw_rate * STEP
        step = self.velocity.scaled(STEP)
        self.world = self.world + step
        self.site = self.site + rotate_to_world(step, self.turn)

    def _later(self, call, *arguments):
        """Do it after the lag, in order: a loop keeps none among calls of one and the same time."""

        def wait():
            self._orders.append((call, arguments))
            self.loop.call_later(self.config.lag, self._obey)

        self.loop.call_soon_threadsafe(wait)

    def _obey(self):
        call, arguments = self._orders.popleft()
        call(*arguments)

    def drive(self, velocity):
        self._later(setattr, self, "requested", velocity)

    async def stop(self, reason):
        self.stops += 1
        self.halt()
        await asyncio.sleep(self.config.lag)

    def halt(self):
        self._later(self._stand)

    def _stand(self):
        self.requested = ZERO_VELOCITY


class Flyer(Walker):
    """One that goes to goals by itself, faster, in the air too."""

    limits = Limits(speed=3.0, vertical_speed=1.0, yaw_rate=2.0, altitude=120.0)
    holonomic = True
    failsafe = "it moves nothing"
    separation = Separation(radius=1.5, braking=1.5, precedence=3)
    engage = 2.0
    goal = None

    def _wanted(self):
        if self.goal is None:
            return super()._wanted()
        left = self.goal - self.world
        speed = min(self.limits.speed, (2 * 0.8 * self.engage * left.norm()) ** 0.5, left.norm() / 0.3)
        return left.scaled(speed / max(left.norm(), 1e-6))

    def _stand(self):
        self.goal = None
        super()._stand()

    def drive(self, velocity):
        self.goal = None
        super().drive(velocity)

    async def navigate(self, task):
        step = task.translation if isinstance(task, RelativeMove) else None
        goal = task.goal.position if step is None else self.world + rotate_to_world(step, self.yaw)
        self._later(setattr, self, "goal", goal)
        while (goal - self.world).norm() > 0.3:
            yield Progress(50.0)
            await asyncio.sleep(0.1)

    @command("takeoff", timeout=60)
    async def takeoff(self, altitude: float = 5.0):
        """Climb."""
        goal = Vector3(self.world.x, self.world.y, altitude)
        self._later(setattr, self, "goal", goal)
        while (goal - self.world).norm() > 0.3:
            yield Progress(50.0)
            await asyncio.sleep(0.1)

    @command("land", timeout=60, safe=True)
    async def land(self):
        """Come down here."""
        self._later(setattr, self, "goal", Vector3(self.world.x, self.world.y, 0.0))
        while self.world.z > 0.3:
            yield Progress(50.0)
            await asyncio.sleep(0.1)


class _Outbox:
    """An outbox that passes the reports of all robots to ``tell``."""

    def __init__(self, tell):
        self._tell = tell

    def sender(self, _twin):
        return self._tell


def local_robot(config, adapter, *, clock, scheduler, tell=lambda _report: None):
    """Return a robot of no process: what it records goes nowhere, what it reports to ``tell``."""
    return LocalRobot(
        config,
        adapter,
        adapter="any",
        edge="yard",
        worker="",
        clock=clock,
        scheduler=scheduler,
        shared=SharedResources(),
        outbox=_Outbox(tell),
        journal=RobotJournal(),
        record=lambda _event: None,
        arrival=clock.monotonic,
        changed=lambda _name: None,
        supervised=SupervisorClient(),
    )


class Field:
    """Robots of one edge by name; ``starts``: class and (x, y, heading) or more fields by name."""

    def __init__(self, starts, **site):
        loop = asyncio.get_running_loop()
        self.clock = LoopClock(loop)
        self.scheduler = TickScheduler(loop, self.clock)
        self.made = {}
        configs = {
            name: WalkerConfig(
                name=name,
                twin=uuid.uuid5(uuid.NAMESPACE_OID, name),
                **({"start": start} if not isinstance(start, dict) else start),
            )
            for name, (_, start) in starts.items()
        }
        edge = {"edge": {"id": "yard"}, "site": site, "robots": ()}
        config = FleetConfig(**edge).model_copy(update={"robots": tuple(configs.values())})
        self.traffic = positions_of(config, self.clock)
        self.robots = {name: self._robot(configs[name], kind) for name, (kind, _) in starts.items()}
        self.calls = []

    def _robot(self, config, kind):
        field = self

        class Made(kind):
            def __init__(self, given, robot):
                super().__init__(given, robot)
                field.made[given.name] = self

        robot = local_robot(config, Made, clock=self.clock, scheduler=self.scheduler)
        robot.share_space(self.traffic)
        return robot

    @contextlib.asynccontextmanager
    async def running(self):
        self.scheduler.start()
        tasks = [robot.start() for robot in self.robots.values()]
        await asyncio.sleep(0.5)
        try:
            yield self
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self.scheduler.stop()

    def request(self, name, what):
        """Ask a robot; return the list that fills with the answers."""
        answers = []
        self.robots[name].controller.receive(
            what, Receipt(getattr(what, "name", "ask"), answers.append, waits=True)
        )
        return answers

    def send(self, name, x, y, z=0.0):
        """Send a robot to a place in the site's frame."""
        placement = self.traffic.in_site(name).placement
        goal = GoTo(Goal(placement.to_world(Vector3(x, y, z))))
        return self.request(name, Navigate(goal, uuid.uuid4().hex, TELE))

    def drive(self, name, x=0.0, y=0.0, turn=0.0):
        """Have a robot hold a body velocity for the lease."""
        return self.request(name, Setpoint(Velocity(Vector3(x, y), turn), origin=TELE))

    def command(self, name, command, **data):
        return self.request(name, Command(command, data, origin=TELE))

    def state(self, name):
        return self.robots[name].state()

    def apart(self, one, other):
        """Return the metres that two robots truly are from each other."""
        return (self.made[one].site - self.made[other].site).norm()
