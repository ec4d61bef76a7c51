"""One robot that is as hard as reality, with a host in front of it, in time that jumps.

Its commands take time, fail in the middle and ignore their cancellation for a while; its stops take seconds
or fail; its radio goes silent and comes back; its process dies and another one begins with its journal.
"""

import asyncio
import contextlib
import itertools
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Literal

import msgspec

from fleet.adapter import Adapter, AdapterConfig
from fleet.commands import command
from fleet.errors import LinkLost, NotReady, Refused, TimedOut
from fleet.host.journal.changes import NetChanges
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.host.runtime.watchdog import WatchedRobot
from fleet.model.command import Command, JointSetpoint, Origin, Reply, Setpoint, Transport
from fleet.model.geometry import Quaternion, Vector3, Velocity
from fleet.model.health import Health, Level
from fleet.model.joints import JointRange
from fleet.model.navigation import Control, Goal, GoTo, Navigate, Progress
from fleet.model.report import JointReport, PoseReport
from fleet.robot_config import Limits
from fleet.supervisor.client import SupervisorClient
from fleet.testing.clock import LoopClock

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
BRAKING = 0.3  # s from a stop to the standstill
SILENT, GONE = 1.0, 3.0  # s without a sound until it is offline, and until its run ends
REPEATS = 12  # repeats of a halt, every 0.1 s: for longer than an outage that nobody notices
FIRMWARE = 1.0  # s after the death of the process in which the firmware ends a velocity
MOVES = frozenset({"velocity", "goal", "walk", "sit", "arm", "land"})
TAG = 1e-4  # m/s or m by which each request differs, so that what reaches the machine names its request


class Order(msgspec.Struct, frozen=True):
    """What reached the machine. ``at``: its place in the order of events; ``latched``: a stop was set."""

    at: int
    time: float
    kind: str
    tag: int
    process: int
    latched: bool


class Machine:
    """The robot itself, as it is in truth; it outlives adapters and processes.

    ``motion``: kind and tag of what it does, None while it stands. ``reached``: what reached it, in order.
    """

    def __init__(self, host: "Host") -> None:
        self.heard = True
        self.motion: tuple[str, int] | None = None
        self.reached: list[Order] = []
        self.finished: set[int] = set()
        self._host = host
        self._stands_at = 0.0

    def _now(self) -> float:
        return self._host.clock.monotonic()

    @property
    def stands(self) -> bool:
        return self.motion is None and self._now() >= self._stands_at

    def order(self, kind: str, tag: int = 0) -> None:
        if not self.heard:
            return
        host = self._host
        latched = host.robot.controller.latched
        self.reached.append(Order(host.count(), self._now(), kind, tag, host.process, latched))
        if kind in {"stop", "halt"}:
            if self.motion is not None:
                self._stands_at = self._now() + BRAKING
            self.motion = None
        elif kind not in {"joints", "held"}:
            self.motion = (kind, tag)

    def finish(self, tag: int) -> None:
        self.finished.add(tag)
        if self.motion is not None and self.motion[1] == tag:
            self.motion, self._stands_at = None, self._now()


class Mood(msgspec.Struct):
    """How the adapter behaves from now on."""

    takes: float = 1.0  # s of a command or goal
    raises: Any = None  # error in the middle of it
    deaf: float = 0.0  # s for which it ignores its cancellation
    stops: Any = None  # error of a stop, or "never"
    connects: float = 0.1  # s
    drives: Any = None  # error of a velocity


class UnrulyConfig(AdapterConfig):
    adapter: Literal["unruly"] = "unruly"
    link: str = "memory:unruly"


class Unruly(Adapter[UnrulyConfig]):
    """The adapter; ``host`` is set by the class that is made of it."""

    Config = UnrulyConfig
    limits = Limits(speed=2.0, vertical_speed=1.0, yaw_rate=1.0)
    failsafe = "its firmware ends a velocity"
    host: "Host"

    async def connect(self):
        self.robot.health(Health(Level.OFFLINE, "it has not spoken yet"))
        await asyncio.sleep(self.host.mood.connects)
        if not self.host.machine.heard:
            raise LinkLost("nobody answers")
        self._heard = self.robot.clock.monotonic()
        self._online = False
        self._halts = 0  # repeats left of a halt that may have been lost
        self.robot.every(0.1, self._listen)

    def _listen(self):
        now = self.robot.clock.monotonic()
        if self._halts:
            self._halts -= 1
            self._order("halt")
        if self.host.machine.heard:
            self._heard = now
            stamp = self.robot.clock.time()
            self.robot.report(PoseReport(stamp, Vector3(), Quaternion()))
            self.robot.report(JointReport(stamp, {"arm": 0.0}))
        quiet = now - self._heard
        if self._online != (quiet < SILENT):
            self._online = quiet < SILENT
            self.robot.health(Health() if self._online else Health(Level.OFFLINE, "silent"))
        if quiet > GONE:
            raise LinkLost("silent for long")

    def _order(self, kind, tag=0):
        if self.host.alive:
            if kind in MOVES:
                self._halts = 0
            self.host.machine.order(kind, tag)

    def drive(self, velocity):
        if velocity.is_zero:
            self.halt()
            return
        if self.host.mood.drives is not None:
            raise self.host.mood.drives
        self._order("velocity", round(velocity.linear.x / TAG) % 5000)

    async def stop(self, reason):
        self.host.stops_given += 1
        mood = self.host.mood
        self._order("stop")
        if isinstance(mood.stops, Exception):
            await asyncio.sleep(0.2)
            raise mood.stops
        machine = self.host.machine
        while mood.stops == "never" or not (machine.stands and machine.heard):  # noqa: ASYNC110 - a robot has no event
            await asyncio.sleep(0.05)

    def halt(self):
        self.host.halts_given += 1
        self._halts = REPEATS
        self._order("halt")

    def joint_ranges(self):
        return {"arm": JointRange(-1.0, 1.0, 0.5)}

    def move_joints(self, targets):
        self._order("joints")

    def hold_joints(self):
        self._order("held")

    async def navigate(self, task):
        tag = round(task.goal.position.x / TAG)
        self._order("goal", tag)
        yield Progress(10)
        await self._work("goal", tag)
        yield Progress(90)

    @command("walk", timeout=8)
    async def walk(self, *, tag: int):
        """Walk somewhere."""
        self._order("walk", tag)
        yield Progress(0)
        await self._work("walk", tag)

    @command("sit", timeout=8, in_place=True)
    async def sit(self, *, tag: int):
        """Sit down."""
        await self._work("sit", tag)

    @command("arm", timeout=8, interrupts=False)
    async def arm(self, *, tag: int):
        """Start the motors."""
        await self._work("arm", tag)

    @command("land", timeout=8, safe=True)
    async def land(self, *, tag: int = 0):
        """Come down."""
        await self._work("land", tag)

    @command("look", timeout=8, moves=False)
    async def look(self, *, tag: int):
        """Look around."""
        await self._pause(self.host.mood.takes)

    async def _work(self, kind, tag):
        """Order it, then once more half-way: a robot takes several orders for a command."""
        mood = self.host.mood
        if isinstance(mood.raises, Refused | NotReady) and kind in {"sit", "arm", "land"}:
            raise mood.raises
        self._order(kind, tag)
        await self._pause(mood.takes / 2)
        if mood.raises is not None:
            raise mood.raises
        self._order(kind, tag)
        await self._pause(mood.takes / 2)
        if self.host.machine.motion != (kind, tag):
            raise TimedOut("it was not seen done")
        if self.host.alive:
            self.host.machine.finish(tag)

    async def _pause(self, seconds):
        deaf = self.host.mood.deaf
        try:
            await asyncio.sleep(seconds)
        except asyncio.CancelledError:
            until = self.robot.clock.monotonic() + deaf
            while (left := until - self.robot.clock.monotonic()) > 1e-6:
                with contextlib.suppress(asyncio.CancelledError):
                    await asyncio.sleep(left)
            raise


class UnrulyRequest(msgspec.Struct):
    """A request, and what became of it. ``at``: its place in the order of events."""

    at: int
    name: str
    tag: int
    process: int
    receipt: Receipt
    answers: list[Reply]
    truths: list[bool]  # whether the machine stood at each answer


class _Nowhere:
    """An outbox for nobody."""

    def sender(self, _twin):
        return lambda _report: None


class Host:
    """One process after the other with the robot in it."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.clock = LoopClock(self.loop)
        self._counter = itertools.count(1)
        self.machine = Machine(self)
        self.mood = Mood()
        self.requested: list[UnrulyRequest] = []
        self.ended_at: list[tuple[int, str]] = []  # stops and other ends of all that was asked before
        self.journal = NetChanges()
        self.process = 0
        self.stops_given = self.halts_given = 0
        self.crashes: list[Exception] = []
        self.not_halted: list[str] = []  # losses of the robot in motion
        self._tags = itertools.count(1)

    def count(self) -> int:
        """Return the place of an event in the order of all."""
        return next(self._counter)

    # -- the process -----------------------------------------------------------------------------------

    def begin(self) -> None:
        """Start a process with what the journal has."""
        self.process += 1
        self.alive = process = SimpleNamespace(number=self.process)
        config = UnrulyConfig(name="rex", twin=TWIN)
        host = self

        class Made(Unruly):
            def __init__(self, given, robot):
                super().__init__(given, robot)
                self.host = _Seen(host, process)

        def put(change):
            if self.alive is process:
                self.journal.add([change])

        self.scheduler = TickScheduler(self.loop, self.clock)
        self.robot = LocalRobot(
            config,
            Made,
            adapter="unruly",
            edge="yard",
            worker="",
            clock=self.clock,
            scheduler=self.scheduler,
            shared=SharedResources(),
            outbox=_Nowhere(),
            journal=RobotJournal(
                "rex",
                put,
                latched=self.journal.latches.get("rex", ""),
                past=[*self.journal.past("rex", ())],
                clock=self.clock,
            ),
            record=lambda _event: None,
            arrival=self.clock.monotonic,
            changed=lambda _name: None,
            supervised=SupervisorClient(),
        )
        self._note_losses(process)
        self._watched: list[WatchedRobot] = []
        self.robot.be_watched(SimpleNamespace(add=lambda _name, watched: self._watched.append(watched)))
        self.scheduler.every(0.02, self._watch)
        self.scheduler.start()
        self.run = self.robot.start()

    def _note_losses(self, process: object) -> None:
        """Note each loss of the robot, and whether one that moves was not halted."""
        controller = self.robot.controller
        lost = controller.lost

        def noted(why):
            moves = controller.in_motion or self.machine.motion is not None
            halted, first = self.halts_given, not controller.offline
            if self.alive is process:
                self.ends(why)
            lost(why)
            if self.alive is process and first and moves and self.halts_given == halted:
                self.not_halted.append(why)

        controller.lost = noted

    def _watch(self) -> None:
        """Do what the watchdog does on its thread."""
        for watched in self._watched:
            if watched.deadman.expire(self.clock.monotonic()):
                watched.halt()
                watched.expired()

    async def die(self) -> None:
        """Kill the process: nothing more of it reaches the machine or the journal."""
        self.alive = None
        self.scheduler.stop()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        until = self.clock.monotonic() + FIRMWARE
        while tasks and self.clock.monotonic() < until:
            for task in tasks:
                task.cancel()
            _, tasks = await asyncio.wait(tasks, timeout=0.1)
        if self.machine.motion is not None and self.machine.motion[0] == "velocity":
            self.machine.motion = None
        self.begin()

    async def leave(self) -> None:
        """End the process in order."""
        self.run.cancel()
        await asyncio.gather(self.run, return_exceptions=True)
        self.scheduler.stop()

    # -- requests --------------------------------------------------------------------------------------

    def ends(self, why: str) -> None:
        """Note that nothing that was asked before this may reach the machine from now on."""
        self.ended_at.append((self.count(), why))

    def request(self, name: str, make: Callable[[int], Any]) -> UnrulyRequest:
        """Ask for what ``make`` returns for the tag of the request."""
        tag = next(self._tags)
        answers: list[Reply] = []
        truths: list[bool] = []

        def answer(reply: Reply) -> None:
            answers.append(reply)
            truths.append(self.machine.stands)

        receipt = Receipt(name, answer, waits=True)
        one = UnrulyRequest(self.count(), name, tag, self.process, receipt, answers, truths)
        self.requested.append(one)
        self.robot.requests.begin(make(tag), receipt)
        return one

    def command(self, name: str, who: str = "anna", **data: Any) -> UnrulyRequest:
        """Ask for a command."""
        return self.request(
            name,
            lambda tag: Command(name, {"tag": tag, **data}, origin=_by(who), id=f"{name}-{tag}"),
        )

    def own(self, name: str, who: str = "anna", **data: Any) -> UnrulyRequest:
        """Ask for a command of the host."""
        return self.request(name, lambda tag: Command(name, data, origin=_by(who), id=f"{name}-{tag}"))

    def drive(self, who: str = "anna", speed: float = 0.5, lease: float | None = None) -> UnrulyRequest:
        """Ask for a velocity; zero ends one."""
        return self.request(
            "move",
            lambda tag: Setpoint(
                Velocity(Vector3(speed and speed + tag * TAG)), lease=lease, origin=_by(who)
            ),
        )

    def lead(self, who: str = "anna") -> UnrulyRequest:
        """Ask for a joint target."""
        return self.request("joints", lambda _tag: JointSetpoint({"arm": 0.5}, origin=_by(who)))

    def send(self, who: str = "anna") -> UnrulyRequest:
        """Ask for a goal."""
        return self.request(
            "navigate", lambda tag: Navigate(GoTo(Goal(Vector3(tag * TAG))), f"goal-{tag}", _by(who))
        )

    def control(self, what: Control, who: str = "anna") -> UnrulyRequest:
        """Ask for a control of the present action."""
        name = str(what)
        if what is not Control.RESUME:
            self.ends(name)
        return self.request(name, lambda _tag: Navigate(what, "", _by(who)))

    def fault(self) -> None:
        """Let the robot report a fault."""
        self.ends("fault")
        self.robot.runner.healthy(Health(Level.FAULT, "a leg is hot"))

    def pilot(self) -> None:
        """Let a pilot take the robot over, and bring it to a standstill."""
        self.ends("pilot")
        adapter = self.robot.controller.attached.adapter
        told = self.robot.controller if adapter is None else adapter.robot
        told.authority_lost("pilot")
        self.machine.motion = None

    def stop(self, name: str = "stop", who: str = "anna") -> UnrulyRequest:
        """Ask for a stop; an emergency stop is set first, as on the thread that received it."""
        self.ends(name)
        if name == "emergency_stop":
            self.robot.controller.emergency(f"{who} asked")
        return self.request(name, lambda _tag: Command(name, origin=_by(who)))


class _Seen:
    """What an adapter sees of its host: ``alive`` while its process is."""

    def __init__(self, host: Host, process: object) -> None:
        self._host, self._process = host, process

    @property
    def alive(self) -> bool:
        return self._host.alive is self._process

    def __getattr__(self, name: str) -> Any:
        return getattr(self._host, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith("_"):
            super().__setattr__(name, value)
        else:
            setattr(self._host, name, value)


def _by(who: str) -> Origin:
    return Origin(Transport.CLOUD, "tele", who)
