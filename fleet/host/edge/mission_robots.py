"""Robots of an edge as mission runs use them, here and in workers, and their capabilities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.config.load import Loaded
from fleet.host.edge.partners import PartnerRobot
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.safety.source_policy import SourcePolicy
from fleet.host.workers.remote_robot import RemoteRobot
from fleet.missions.plan import plans_taken
from fleet.missions.roles import RoleCandidate
from fleet.missions.run import RunPort
from fleet.missions.state import Facts
from fleet.model.command import Request, Transport
from fleet.model.description import RobotDescription
from fleet.model.report import Report
from fleet.model.state import RobotState
from fleet.robot_config import AdapterConfig
from fleet.runtime.decoding import decode_json
from fleet.wire.rules import Kind

DESCRIBED_WITHIN = 2.0  # s for other processes to describe their robots


class RobotRules:
    """Accepted senders of missions for each robot, and the greatest age of a start (s), by name."""

    def __init__(self, loaded: Loaded) -> None:
        self.policies: dict[str, SourcePolicy] = {}
        self.max_age: dict[str, float] = {}
        self.configure(loaded)

    def configure(self, loaded: Loaded) -> None:
        """Apply another configuration with its robots."""
        for gone in self.policies.keys() - {robot.name for robot, _ in loaded.robots}:
            self.leave(gone)
        for robot, _ in loaded.robots:
            self.join(robot)

    def join(self, robot: AdapterConfig) -> None:
        """Add the rules of a robot, before anything else uses it."""
        self.policies[robot.name] = SourcePolicy(robot.accepts, simulated=robot.simulated)
        self.max_age[robot.name] = robot.command_max_age

    def leave(self, name: str) -> None:
        """Remove the rules of a robot."""
        self.policies.pop(name, None)
        self.max_age.pop(name, None)


class LocalRunPort:
    """A robot of this process, as a run uses it."""

    def __init__(self, robot: LocalRobot) -> None:
        self._robot = robot
        self.name = robot.name
        self.state = robot.state
        self.describe = robot.describe

    def read(
        self, kind: Kind, payload: bytes, *, transport: Transport, request_id: str = "", waits: bool = False
    ) -> Request | None:
        """Decode a message; the returned request executes it."""
        return self._robot.read(kind, payload, transport=transport, request_id=request_id, waits=waits)


class RemoteRunPort:
    """A robot in a worker, which describes it."""

    def __init__(self, robot: RemoteRobot) -> None:
        self._robot = robot
        self.name = robot.name
        self.state = robot.state

    def read(
        self, kind: Kind, payload: bytes, *, transport: Transport, request_id: str = "", waits: bool = False
    ) -> Request | None:
        """Decode a message; the returned request executes it."""
        return self._robot.read(kind, payload, transport=transport, request_id=request_id, waits=waits)


class MissionRobots:
    """Robots that runs of an edge may use, by name: of this edge, and of its partners.

    ``ours`` are those of this edge, ``here`` and ``remote`` (in workers); ``edges`` maps robots that other
    processes describe to their edges, ``names`` twins to names, ``senders`` robots to their report senders.
    """

    def __init__(
        self,
        edge: str,
        robots: Iterable[LocalRobot | RemoteRobot],
        partners: Mapping[str, PartnerRobot],
        sender: Callable[[str], Callable[[Report], None]],
    ) -> None:
        self._edge, self._sender = edge, sender
        self.here: dict[str, LocalRunPort] = {}
        self.remote: dict[str, RemoteRunPort] = {}
        self.ours: dict[str, RunPort] = {}
        self.everyones: dict[str, RunPort] = dict(partners)
        self.edges = {name: robot.edge for name, robot in partners.items()}
        self.names: dict[str, str] = {}
        self.senders: dict[str, Callable[[Report], None]] = {}
        for robot in robots:
            self.join(robot)

    def join(self, robot: LocalRobot | RemoteRobot) -> None:
        """Add a robot of this edge."""
        name = robot.name
        ours: RunPort
        if isinstance(robot, LocalRobot):
            ours = self.here[name] = LocalRunPort(robot)
        else:
            ours = self.remote[name] = RemoteRunPort(robot)
            self.edges[name] = self._edge
        self.everyones[name] = self.ours[name] = ours
        self.names[robot.twin] = name
        self.senders[name] = self._sender(robot.twin)

    def leave(self, name: str) -> str:
        """Remove a robot; return its twin, empty if another robot has that by now."""
        tables: tuple[dict[str, Any], ...] = (self.here, self.remote, self.ours)
        for table in (*tables, self.everyones, self.edges, self.senders):
            table.pop(name, None)
        twin = next((twin for twin, named in self.names.items() if named == name), "")
        self.names.pop(twin, None)
        return twin


class Descriptions:
    """Descriptions of robots in other processes; ``edges`` maps their names to edges, and may change."""

    def __init__(
        self, control: ZenohSession, soon: Callable[[Callable[[], None]], None], edges: Mapping[str, str]
    ) -> None:
        self._control, self._soon, self._edges = control, soon, edges
        self._descriptions: dict[str, RobotDescription] = {}

    def of(self, name: str) -> RobotDescription | None:
        """Return a robot's description; None before it was received."""
        return self._descriptions.get(name)

    def request(self, then: Callable[[], None]) -> None:
        """Query all descriptions, then call ``then``, on the event loop."""
        waiting = set(self._edges)
        if not waiting:
            self._soon(then)

        def on_description(name: str, data: bytes) -> None:
            self._descriptions[name] = decode_json(data, RobotDescription)

        def ended(name: str) -> None:
            waiting.discard(name)
            if not waiting:
                self._soon(then)

        for name in sorted(self._edges):
            self._control.request_later(
                keys.description(self._edges[name], name),
                b"",
                timeout=DESCRIBED_WITHIN,
                on_answer=partial(on_description, name),
                on_end=partial(self._soon, partial(ended, name)),
            )


def can(description: RobotDescription | None) -> frozenset[str]:
    """Return the capabilities of a robot, for the choice of robots."""
    if description is None:
        return frozenset()
    names = {command.name for command in description.commands}
    motions = {"goto", "path"} if description.goals else set()
    motions |= {"follow"} if description.drives else set()
    return frozenset(names | motions | (plans_taken(description.plans) if description.missions else set()))


def trouble(state: RobotState, description: RobotDescription | None) -> str:
    """Return why a robot cannot take part in any run now."""
    if not state.reachable:
        return f"it is offline: {state.cause}"
    if state.emergency_stop:
        return f"its emergency stop is set: {state.stop_cause}"
    return "" if description is not None else "its worker does not say what it takes"


def candidate(
    state: RobotState, description: RobotDescription | None, groups: Mapping[str, Iterable[str]]
) -> RoleCandidate:
    """Return a robot as a candidate for a run."""
    at = state.site or state.position
    position = (at.x, at.y, at.z) if at is not None else None
    facts = Facts(state.name, state.health, state.battery, position, state.activity)
    return RoleCandidate(
        state.name,
        state.adapter,
        can(description),
        facts,
        frozenset(name for name, members in groups.items() if state.name in members),
        trouble(state, description),
        state.run,
    )
