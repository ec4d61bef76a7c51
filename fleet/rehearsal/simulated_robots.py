"""The robots of a rehearsal: each robot of the edge at its present position, simulated or by a stand-in.

They are robots of the host: the same admission, limits, fences, battery policy, follower and separation. Only
the side behind their adapters is simulated, in this process and in the time of its event loop. There is no
bus and no watchdog: in simulated time nothing blocks.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from fleet.adapter import Adapter, Robot
from fleet.clock import Clock
from fleet.host.edge.rehearsal_task import PlacedRobot, RehearsalTask
from fleet.host.journal.journal import RobotJournal
from fleet.host.robot.adapter_factory import AdapterClass
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.robot.report_queue import ReportQueue
from fleet.host.robot.robot_positions import RobotPositions
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import TICK, TickScheduler
from fleet.host.safety.source_policy import SourcePolicy
from fleet.host.workers.worker_task import Importer
from fleet.link.memory import MemoryRobot
from fleet.model.event import EventReport
from fleet.model.geodesy import GeoOrigin, geo_from_world
from fleet.model.geometry import Pose, quaternion_from_yaw
from fleet.model.report import Report
from fleet.model.state import RobotState
from fleet.rehearsal.stand_in import BATTERY, POSE, stand_in_for
from fleet.robot_config import Accepts, AdapterConfig
from fleet.runtime.simulated_time import EPOCH
from fleet.simulation import Simulation, SimulationStart
from fleet.supervisor.client import SupervisorClient

PARKED = "stand-in that stands where the robot is"
STAND_IN = "kinematic stand-in: {} has no simulator that runs in simulated time"


class RobotSubstitute(msgspec.Struct, frozen=True):
    """Replacement of a robot: its adapter's class with a config for a simulation, or a stand-in."""

    name: str
    kind: str
    played_by: str
    adapter: AdapterClass
    config: AdapterConfig
    policy: SourcePolicy
    simulation: Simulation | None = None


class SimulatedRobots:
    """All robots that take part or stand in the way, in the time of the running event loop.

    ``heard`` receives the events of robots.
    """

    def __init__(
        self,
        players: Iterable[RobotSubstitute],
        site: GeoOrigin | None,
        clock: Clock,
        heard: Callable[[str, str], None],
    ) -> None:
        self.players = {player.name: player for player in players}
        self.scheduler = TickScheduler(asyncio.get_running_loop(), clock)
        self.traffic = RobotPositions(site, self.players, clock)
        self._clock = clock
        self._heard = heard
        self._shared = SharedResources()
        self.robots = {name: self._robot(player) for name, player in self.players.items()}

    def _robot(self, player: RobotSubstitute) -> LocalRobot:
        """Build one robot."""

        def record(event: EventReport) -> None:
            self._heard(player.name, event.kind.value)

        robot = LocalRobot(
            player.config,
            player.adapter,
            adapter=player.kind,
            edge="rehearsal",
            worker="",
            clock=self._clock,
            scheduler=self.scheduler,
            shared=self._shared,
            outbox=_NullReportQueue(),
            journal=RobotJournal(),
            record=record,
            arrival=self._clock.monotonic,
            changed=lambda _name: None,
            supervised=SupervisorClient(),
        )
        robot.share_space(self.traffic)
        return robot

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Run all robots for the time of a block."""
        with contextlib.ExitStack() as simulators:
            for player in self.players.values():
                if player.simulation is not None:
                    self._simulate(player.name, player.simulation, simulators)
            self.scheduler.start()
            tasks = [robot.start() for robot in self.robots.values()]
            try:
                yield
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
                self.scheduler.stop()

    def _simulate(self, name: str, simulation: Simulation, simulators: contextlib.ExitStack) -> None:
        """Connect a simulated robot to its memory link."""
        began = self._clock.monotonic()

        def receive(data: bytes) -> bytes:
            return simulation.receive(data, self._clock.monotonic() - began)

        peer = simulators.enter_context(MemoryRobot(name, receive))

        def step() -> None:
            data = simulation.step(self._clock.monotonic() - began)
            if data:
                peer.say(data)

        self.scheduler.every(TICK, step)


class _NullReportQueue(ReportQueue):
    """A report queue without a bus."""

    def __init__(self) -> None:
        """Create it without its base's resources."""

    def sender(self, twin: str) -> Callable[[Report], None]:  # noqa: ARG002 - the interface
        """Return a function that drops reports."""
        return lambda _report: None


def substitutes_of(task: RehearsalTask) -> list[RobotSubstitute]:
    """Return the players of a task's robots; raises ConfigError for an adapter that cannot be used here.

    A robot without a role stands at its position; it is left out if that is unknown.
    """
    importer = Importer(Path(task.folder))
    taken = {name for names in task.roles.values() for name in names}
    return [
        _player(placed, importer, task, takes_part=placed.state.name in taken)
        for placed in task.robots
        if placed.state.name in taken or placed.state.site is not None
    ]


def _player(
    placed: PlacedRobot, importer: Importer, task: RehearsalTask, *, takes_part: bool
) -> RobotSubstitute:
    """Return the player of one robot."""
    spec, state = importer.spec(placed.task), placed.state
    policy = SourcePolicy(spec.config.accepts, simulated=spec.config.simulated)
    accepts = Accepts.model_validate(
        {"command": policy.command, "navigate": policy.navigate, "mission": policy.mission or None}
    )
    config = spec.config.model_copy(update={"accepts": accepts})
    start = start_of(state, task.site, task.seed)
    kind, played = placed.task.adapter, spec.plugin
    if not played.tells_home:
        config = _placed(config, state)
    simulation = played.simulation(config, start) if takes_part else None
    if simulation is not None:
        adapter = _with_state(played, simulation.state) if simulation.state else played
        return RobotSubstitute(
            state.name, kind, simulation.what, adapter, simulation.config, policy, simulation
        )
    found = {POSE: start.pose} | ({} if start.battery is None else {BATTERY: start.battery})
    who = STAND_IN.format(kind) if takes_part else PARKED
    adapter = _with_state(stand_in_for(played), found)
    return RobotSubstitute(state.name, kind, who, adapter, _placed(config, state), policy)


def start_of(state: RobotState, site: GeoOrigin | None, seed: int) -> SimulationStart:
    """Return the start of a simulation from a robot's present state."""
    pose = Pose()
    if state.position is not None:
        pose = Pose(state.position, quaternion_from_yaw(state.heading or 0.0))
    point = geo_from_world(site, state.site) if site is not None and state.site is not None else None
    return SimulationStart(
        pose,
        point,
        _heading(state),
        state.battery,
        state.mode,
        armed=bool(state.armed),
        seed=seed,
        epoch=EPOCH,
    )


def _heading(state: RobotState) -> float | None:
    """Return the heading of a robot in the site's frame."""
    if state.heading is None or state.placement is None:
        return None
    return state.heading + state.placement.yaw


def _placed(config: AdapterConfig, state: RobotState) -> AdapterConfig:
    """Return a config that places the robot at its present position, with its world frame unchanged."""
    if state.site is None:
        return config
    start = (state.site.x, state.site.y, _heading(state) or 0.0)
    return config.model_copy(update={"start": start, "origin": None})


def _with_state(adapter: AdapterClass, state: Mapping[str, Any]) -> AdapterClass:
    """Return a subclass of an adapter's class with initial values in ``robot.state``."""
    assert issubclass(adapter, Adapter)
    base: type[Adapter[Any]] = adapter

    class Placed(base):  # type: ignore[misc, valid-type]
        """The adapter with initial values in ``robot.state``."""

        def __init__(self, config: Any, robot: Robot) -> None:
            for key, value in state.items():
                robot.state.setdefault(key, value)
            super().__init__(config, robot)

    return Placed
