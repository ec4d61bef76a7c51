"""The fleet as a page shows it, in versioned entries; pure.

A page knows everything up to a version, and receives the entries that changed since. So a slow page gets
fewer, newer messages instead of a queue. Entries stay as long as the console lives: a robot that vanishes is
shown as gone, not removed. Only missions and schedules are removed, with the value None, when their edge no
longer has them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from fleet.missions.report import MissionState, RunState
from fleet.model.description import RobotDescription
from fleet.model.geometry import Vector3, wrap_angle
from fleet.model.report import PoseReport
from fleet.model.schedule import ScheduleState
from fleet.model.state import EdgeState, RobotState

KINDS = (
    "edges",
    "robots",
    "poses",
    "goals",
    "descriptions",
    "stops",
    "missions",
    "runs",
    "numbers",
    "photos",
    "schedules",
    "requests",
)
"""The kinds of entries, in the order in which a page handles them."""
MOST_STOPS = 20  # shown stops; older ones are in the history
MOST_RUNS = 30
_FIGURE = re.compile(r"\d+(\.\d+)?")
ROUNDED = 3  # decimals of metres and radians: below the resolution of a map


class Goals(msgspec.Struct, frozen=True):
    """Goals of robots, published by a process of an edge (``fleet/{edge}/places/{process}``)."""

    robots: tuple[GoalEntry, ...] = ()


class GoalEntry(msgspec.Struct, frozen=True):
    """One robot of the message."""

    robot: RobotPath


class RobotPath(msgspec.Struct, frozen=True):
    """Its name, and the points of its path in the site's frame, m."""

    name: str
    route: tuple[Vector3, ...] = msgspec.field(name="way", default=())


def id_of(edge: str, robot: str) -> str:
    """Return the identity of a robot among several edges."""
    return f"{edge}/{robot}"


class FleetView:
    """The entries by kind and identity; ``version`` grows with each change.

    ``states`` are the robots' newest states by identity. Times are monotonic seconds of this process.
    """

    def __init__(self) -> None:
        self.version = 0
        self.states: dict[str, RobotState] = {}
        self.edges: dict[str, EdgeState] = {}
        self._alive: dict[str, bool] = {}
        self._health: dict[str, tuple[tuple[str, str], float]] = {}
        self._problems: dict[str, str] = {}
        self._by_twin: dict[str, str] = {}
        self._entries: dict[str, dict[str, tuple[int, Any]]] = {kind: {} for kind in KINDS}

    def since(self, version: int) -> dict[str, dict[str, Any]]:
        """Return the entries that changed after a version, by kind and identity; 0 returns all there are."""
        found = {
            kind: {
                name: value
                for name, (at, value) in entries.items()
                if at > version and (version or value is not None)
            }
            for kind, entries in self._entries.items()
        }
        return {kind: entries for kind, entries in found.items() if entries}

    def put(self, kind: str, name: str, value: object) -> None:
        """Set an entry; an equal value is no change."""
        entries = self._entries[kind]
        if name in entries and entries[name][1] == value:
            return
        self.version += 1
        entries.pop(name, None)  # so that the newest is last
        entries[name] = (self.version, value)

    def get(self, kind: str, name: str) -> Any:
        """Return an entry, None if there is none."""
        entry = self._entries[kind].get(name)
        return None if entry is None else entry[1]

    def update_state(self, state: RobotState, now: float) -> None:
        """Update a robot's state, unless it is older than the known one."""
        name = id_of(state.edge, state.name)
        known = self.states.get(name)
        if known is not None and state.stamp < known.stamp:
            return
        self.states[name] = state
        self._by_twin[state.twin] = name
        shown: dict[str, Any] = msgspec.to_builtins(msgspec.structs.asdict(state))
        shown |= {"id": name, "heard": round(now, 1), "since": self._since(name, state)}
        self.put("robots", name, shown)
        if self.get("poses", name) is None and (at := state.site or state.position) is not None:
            self.put("poses", name, [*_rounded((at.x, at.y, at.z)), None, state.site is not None])

    def _since(self, name: str, state: RobotState) -> float:
        """Return since when a robot has its present health; changed figures do not make it a new cause."""
        how = (state.health, _FIGURE.sub("#", state.cause))
        known = self._health.get(name)
        if known is None or known[0] != how:
            self._health[name] = known = (how, state.stamp)
        return known[1]

    def update_edge(self, state: EdgeState, now: float) -> None:
        """Update an edge's own state."""
        known = self.edges.get(state.edge)
        if known is None or state.stamp >= known.stamp:
            self.edges[state.edge] = state
            self._alive[state.edge] = True
            self._show_edge(state.edge, now)

    def set_edge_state(self, edge: str, *, alive: bool, problem: str = "", now: float) -> None:
        """Set whether an edge runs, and the reason if it is not reached."""
        self._alive[edge], self._problems[edge] = alive, problem
        self._show_edge(edge, now)

    def _show_edge(self, edge: str, now: float) -> None:
        """Set the entry of an edge."""
        state = self.edges.get(edge)
        shown: dict[str, Any] = msgspec.to_builtins(msgspec.structs.asdict(state)) if state else {}
        entry = {"edge": edge, "alive": self._alive.get(edge, False), "problem": self._problems.get(edge, "")}
        self.put("edges", edge, {"heard": round(now, 1)} | shown | entry)

    def update_pose(self, twin: str, pose: PoseReport) -> None:
        """Update the pose of a robot."""
        name = self._by_twin.get(twin)
        if name is not None:
            self.put("poses", name, self.shown_pose(name, pose))

    def shown_pose(self, name: str, pose: PoseReport) -> list[Any]:
        """Return the pose of a known robot: in the site's frame if placed there, else in its own.

        An entry is x, y, z (m), yaw (rad; None if unknown), and whether it is in the site's frame.
        """
        placement = self.states[name].placement
        at, yaw = pose.position, pose.rotation.yaw
        if placement is not None:
            at, yaw = placement.to_site(at), wrap_angle(yaw + placement.yaw)
        return [*_rounded((at.x, at.y, at.z, yaw)), placement is not None]

    def update_goals(self, edge: str, goals: Goals) -> None:
        """Update the goals of the robots of an edge."""
        for entry in goals.robots:
            name = id_of(edge, entry.robot.name)
            route = [list(_rounded((point.x, point.y, point.z))) for point in entry.robot.route]
            if route or self.get("goals", name) is not None:
                self.put("goals", name, route)

    def update_description(self, edge: str, description: RobotDescription) -> None:
        """Update a robot's vocabulary, and whether it would accept each command now."""
        self.put("descriptions", id_of(edge, description.robot), msgspec.to_builtins(description))

    def update_stop(self, request: str, shown: Mapping[str, object]) -> None:
        """Update the progress of a stop; the oldest stops are removed."""
        self.put("stops", request, dict(shown))
        self._keep("stops", MOST_STOPS)

    def update_run(self, run: RunState) -> None:
        """Update a run of a mission; those with the oldest change are removed."""
        self.put("runs", f"{run.edge}/{run.run}", msgspec.to_builtins(run))
        self._keep("runs", MOST_RUNS)

    def update_schedules(self, edge: str, schedules: Iterable[ScheduleState]) -> None:
        """Update all schedules of an edge."""
        shown = {each.name: {"edge": edge, **msgspec.to_builtins(each)} for each in schedules}
        self._replace("schedules", edge, shown)

    def update_missions(self, missions: Iterable[MissionState]) -> None:
        """Update all missions of one or more edges; those of others stay as they are."""
        by_edge: dict[str, dict[str, Any]] = {}
        for each in missions:
            by_edge.setdefault(each.edge, {})[each.name] = msgspec.to_builtins(each)
        for edge, shown in by_edge.items():
            self._replace("missions", edge, shown)

    def _replace(self, kind: str, edge: str, shown: Mapping[str, object]) -> None:
        """Set the entries of an edge, and remove those that it no longer has."""
        for name, value in shown.items():
            self.put(kind, id_of(edge, name), value)
        for key in list(self._entries[kind]):
            of, _, name = key.partition("/")
            if of == edge and name not in shown:
                self.put(kind, key, None)

    def _keep(self, kind: str, most: int) -> None:
        """Remove the entries with the oldest change."""
        entries = self._entries[kind]
        while len(entries) > most:
            entries.pop(next(iter(entries)))

    def named(self, names: Iterable[str]) -> list[RobotState]:
        """Return the states of robots by their identities; unknown ones are skipped."""
        return [self.states[name] for name in names if name in self.states]


def _rounded(values: Iterable[float]) -> Iterable[float]:
    """Return numbers rounded to the resolution of a map."""
    return (round(value, ROUNDED) for value in values)
