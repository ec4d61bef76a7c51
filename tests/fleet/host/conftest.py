"""A robot in memory, and a controller in front of it, with a clock that tests turn."""

import asyncio
import contextlib
import json
import logging
import shutil
import tempfile
import threading
import uuid
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import pytest

from fleet.adapter import Adapter, AdapterConfig, Robot
from fleet.bus.bus import join_control
from fleet.bus.settings import BusSettings
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import SystemClock
from fleet.commands import command
from fleet.config.load import load
from fleet.errors import Refused
from fleet.host.edge.edge import Edge
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import capabilities
from fleet.host.robot.controller import RobotController
from fleet.model.command import Command, Origin, Reply, Setpoint, Transport
from fleet.model.geometry import Quaternion, Vector3, Velocity
from fleet.model.navigation import Goal, GoTo, Navigate, Progress
from fleet.model.report import BatteryReport, PoseReport, TelemetryReport
from fleet.robot_config import Limits
from fleet.testing.clock import ManualClock
from fleet.testing.robot import RecordingRobot
from tests.tools.command_line import run_main
from tests.tools.waiting import DEADLINE

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"


class FakeAdapterConfig(AdapterConfig):
    adapter: Literal["puppet"] = "puppet"
    link: str = "memory:puppet"


class FakeAdapter(Adapter[FakeAdapterConfig]):
    """A robot that records what it is told and does what the test says."""

    Config = FakeAdapterConfig
    limits = Limits(speed=2.0, vertical_speed=1.0, yaw_rate=1.0)
    failsafe = "it moves nothing"

    def __init__(self, config: FakeAdapterConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        self.calls: list[Any] = []
        self.go = asyncio.Event()
        self.raises: BaseException | None = None  # in drive, navigate and takeoff
        self.halts: BaseException | None = None  # what a halt raises
        self.stops: BaseException | str = ""  # what a stop raises, or "never": it does not return

    def drive(self, velocity):
        self._maybe_raise()
        self.calls.append(velocity)

    async def stop(self, reason):
        self.calls.append("stop")
        while self.stops == "never" and not self.go.is_set():
            with contextlib.suppress(asyncio.CancelledError):
                await self.go.wait()
        if isinstance(self.stops, BaseException):
            raise self.stops

    def halt(self):
        self.calls.append("halt")
        if self.halts is not None:
            raise self.halts

    async def navigate(self, task) -> AsyncIterator[Progress]:
        self.calls.append(task)
        yield Progress(10)
        self._maybe_raise()
        await self.go.wait()
        yield Progress(90)

    @command("takeoff", timeout=5)
    async def takeoff(self, altitude: float | None = None):
        """Take off."""
        self._maybe_raise()
        self.calls.append(("takeoff", altitude))
        yield Progress(0)
        await self.go.wait()
        self._maybe_raise()

    @command("arm", interrupts=False)
    async def arm(self):
        """Start the motors."""
        self.calls.append("arm")

    @command("land", safe=True, timeout=5)
    async def land(self):
        """Land."""
        self.calls.append("land")

    @command("battery_check", moves=False, safe=True)
    async def battery_check(self):
        """Look at the battery."""
        self.calls.append("battery_check")

    @command("shy")
    async def shy(self):
        """Refuse."""
        raise Refused("not today", device_result="MAV_RESULT_DENIED", messages=("Arm: no GPS",))

    def _maybe_raise(self):
        if self.raises is not None:
            raise self.raises


class Bench:
    """A controller with a fake robot, and everything that came out of it."""

    def __init__(self, journal: RobotJournal | None = None, **config: Any) -> None:
        self.clock = ManualClock()
        self.reports: list[Any] = []
        self.crashes: list[Exception] = []
        self.restarts: list[int] = []
        self.config = FakeAdapterConfig(name="rex", twin=TWIN, **config)
        self.controller = RobotController(
            self.config,
            capabilities(FakeAdapter),
            publish=self.reports.append,
            crashed=self.crashes.append,
            journal=journal or RobotJournal(),
            restart=lambda: self.restarts.append(1),
            clock=self.clock,
        )
        self.adapter = FakeAdapter(self.config, RecordingRobot())
        self.controller.attach(self.adapter)
        self.controller.found()

    def request(self, what: Any, *, waits: bool = False) -> list[Reply]:
        """Ask the controller; the list fills with the answers."""
        answers: list[Reply] = []
        self.controller.receive(what, Receipt(getattr(what, "name", "navigate"), answers.append, waits=waits))
        return answers

    def statuses(self) -> list[str]:
        """Return the states of all navigation statuses, in order."""
        return [str(report.state) for report in self.reports if hasattr(report, "state")]

    def telemetry_of(self, kind: str) -> list[TelemetryReport]:
        """Return what was told of a kind on the telemetry channel."""
        return [each for each in self.reports if isinstance(each, TelemetryReport) and each.type == kind]

    def report_pose(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, rotation: Any = None) -> None:
        """Let the robot say where it is."""
        report = PoseReport(self.clock.time(), Vector3(x, y, z), rotation or Quaternion())
        self.controller.observe(report)
        self.controller.guard.observe(report)

    def report_battery(self, percent: float) -> None:
        """Let the robot say how full its battery is."""
        self.controller.guard.observe(BatteryReport(0.0, percent))


def a_command(name: str, source: str | None = "tele", session: str = "anna", **fields: Any) -> Command:
    return Command(name, origin=Origin(Transport.CLOUD, source, session), **fields)


def a_setpoint(x: float = 1.0, source: str | None = "tele", session: str = "anna", **fields: Any) -> Setpoint:
    return Setpoint(Velocity(Vector3(x=x)), origin=Origin(Transport.CLOUD, source, session), **fields)


def a_goal(action: str = "a1", source: str = "tele", session: str = "anna", **fields: Any) -> Navigate:
    goal = GoTo(Goal(Vector3(1, 2, 3)))
    return Navigate(goal, action, Origin(Transport.CLOUD, source, session), **fields)


async def settle() -> None:
    """Let everything that can run, run."""
    for _ in range(10):
        await asyncio.sleep(0)


async def until(condition: Callable[[], Any], within: float = DEADLINE) -> None:
    """Wait until something holds; raises TimeoutError."""
    async with asyncio.timeout(within):
        while not condition():  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.005)


@pytest.fixture
async def bench() -> Bench:
    return Bench()


@pytest.fixture
async def make_bench() -> AsyncIterator[Callable[..., Bench]]:
    """Return the maker of benches. What one has begun goes on, though nobody names it any more, to the end.

    A controller that is collected with an action under way has its tasks broken off as no process does it.
    """
    made: list[Bench] = []

    def make(**options: Any) -> Bench:
        made.append(Bench(**options))
        return made[-1]

    yield make
    for bench in made:
        bench.adapter.go.set()
    begun = asyncio.all_tasks() - {asyncio.current_task()}
    for task in begun:
        task.cancel()
    await asyncio.gather(*begun, return_exceptions=True)


@pytest.fixture
def requests() -> Any:
    """Return the makers of asks, as one value."""

    class RequestFactory:
        command = staticmethod(a_command)
        setpoint = staticmethod(a_setpoint)
        goal = staticmethod(a_goal)
        settle = staticmethod(settle)
        until = staticmethod(until)

    return RequestFactory


TOY = '''
"""A robot that writes down what it is told, with the process and the time."""
import asyncio, os, signal, time
from typing import Literal
import fleet


class ToyConfig(fleet.AdapterConfig):
    adapter: Literal["toy"]
    journal: str
    stands: bool = False  # it tells a pose
    fix: bool = True  # it is ready to take off


class Toy(fleet.Adapter[ToyConfig]):
    Config = ToyConfig
    limits = fleet.Limits(speed=2.0, yaw_rate=1.0)
    failsafe = "it moves nothing"

    def note(self, word):
        with open(self.config.journal, "a") as journal:
            journal.write(f"{os.getpid()} {time.monotonic()} {self.config.name} {word}\\n")

    async def connect(self):
        self.note("run")
        if self.config.stands:
            pose = fleet.PoseReport(0.0, fleet.Vector3(), fleet.quaternion_from_yaw(0.0))
            self.robot.every(0.1, lambda: self.robot.report(pose))

    def drive(self, velocity):
        self.note(f"drive:{velocity.linear.x:g}")

    async def stop(self, reason):
        self.note("stop")

    def halt(self):
        self.note("halt")

    async def navigate(self, task):
        self.note("navigate")
        yield fleet.Progress(1)
        await asyncio.Event().wait()

    @fleet.command("takeoff")
    async def takeoff(self):
        self.note("takeoff")

    @fleet.command("check_ready", moves=False)
    async def check_ready(self):
        gps = {"check": "gps", "ok": self.config.fix, "words": [] if self.config.fix else ["no fix"]}
        return {"ready": self.config.fix, "checks": [gps]}

    @fleet.command("walk")
    async def walk(self):
        self.note("walk")

    @fleet.command("hang", moves=False)
    async def hang(self):
        self.note("hang")
        time.sleep(600)

    @fleet.command("freeze", moves=False)
    async def freeze(self):
        os.kill(os.getpid(), signal.SIGSTOP)

    @fleet.command("die", moves=False)
    async def die(self):
        os.kill(os.getpid(), signal.SIGKILL)
'''


class Yard:
    """A fleet of toys on disk: its fleet.yaml, its sockets, and what its robots were told."""

    def __init__(self, folder: Path, runtime: Path, robots: dict[str, dict[str, Any]]) -> None:
        self.runtime = runtime
        self.journal = folder / "journal"
        self.file = folder / "fleet.yaml"
        self.id = f"yard-{uuid.uuid4().hex[:8]}"
        (folder / "plugins").mkdir()
        (folder / "plugins" / "toy.py").write_text(TOY)
        entries = [
            {"name": name, "twin": str(uuid.uuid4()), "adapter": "toy", "journal": str(self.journal), **more}
            for name, more in robots.items()
        ]
        fleet = {"edge": {"id": self.id}, "plugins": ["plugins"], "robots": entries}
        self.file.write_text(json.dumps(fleet))

    def change(self, **parts: Any) -> None:
        """Change parts of fleet.yaml; those within ``edge`` are added to its id."""
        fleet = json.loads(self.file.read_text())
        parts["edge"] = fleet["edge"] | parts.get("edge", {})
        self.file.write_text(json.dumps(fleet | parts))

    def calls(self, robot: str = "") -> list[tuple[int, float, str]]:
        """Return what the robots, or one of them, were told: process, monotonic seconds, word."""
        lines = self.journal.read_text().splitlines() if self.journal.exists() else []
        rows = [line.split() for line in lines if line.count(" ") == 3]
        return [(int(pid), float(at), word) for pid, at, name, word in rows if name == robot or not robot]

    def words(self, robot: str = "") -> list[str]:
        """Return what the robots, or one of them, were told, without process and time."""
        return [word for _, _, word in self.calls(robot)]

    def processes(self, robot: str) -> list[int]:
        """Return the processes in which a robot ran, in order."""
        return [pid for pid, _, word in self.calls(robot) if word == "run"]

    def bus_session(self) -> ZenohSession:
        """Return the way by which the command line asks."""
        return join_control(BusSettings(self.id), self.runtime)

    def edge(self) -> Edge:
        """Return an edge of this process."""
        return Edge(load(self.file), directory=self.runtime, clock=SystemClock())


@pytest.fixture
def yard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_probes: None
) -> Iterator[Callable[..., Yard]]:
    """Return the maker of a yard; the robots' further fields by name."""
    runtime = Path(tempfile.mkdtemp())
    monkeypatch.setenv("FLEET_RUNTIME_DIR", str(runtime))
    yield lambda **robots: Yard(tmp_path, runtime, robots)
    shutil.rmtree(runtime, ignore_errors=True)  # a process that ends may remove its socket meanwhile


@contextlib.asynccontextmanager
async def running(edge: Edge) -> AsyncIterator[asyncio.Task[None]]:
    """Run an edge; end it in order."""
    ended = asyncio.Event()
    task = asyncio.create_task(edge.run(ended))
    try:
        yield task
    finally:
        ended.set()
        await asyncio.wait_for(task, DEADLINE)


@pytest.fixture
def run_edge() -> Any:
    return running


class _Blocked(logging.Handler):
    """A handler that holds up who logs, as a full pipe or a disk that hangs would, until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.free = threading.Event()

    def emit(self, _record: logging.LogRecord) -> None:
        self.free.wait(20)


@contextlib.contextmanager
def block_log(name: str) -> Iterator[None]:
    """Hold up whoever logs to a logger of this name while a ``with`` block lasts."""
    handler = _Blocked()
    logging.getLogger(name).addHandler(handler)
    try:
        yield
    finally:
        handler.free.set()
        logging.getLogger(name).removeHandler(handler)


@pytest.fixture
def blocked_log() -> Any:
    return block_log


@pytest.fixture
def fleet(capsys: pytest.CaptureFixture[str]) -> Any:
    """Run one command line on a thread, beside an edge; gives its exit code, and its output and errors."""

    async def fleet(*arguments: str) -> tuple[int, str, str]:
        code = await asyncio.to_thread(run_main, arguments)
        said = capsys.readouterr()
        return code, said.out, said.err

    return fleet
