"""Connection from a command to the running edges, over their control sessions."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Self, TypeVar

import msgspec

from fleet.bus import keys
from fleet.bus.bus import join_control
from fleet.bus.settings import BusSettings, client_dirs, running_edges
from fleet.bus.zenoh_session import ZenohSession
from fleet.config.text import nearest
from fleet.errors import BusError, NotRunning, Refused, TimedOut
from fleet.history.event_filter import EventFilter, newest
from fleet.history.record import Record
from fleet.model.command import Reply
from fleet.model.description import RobotDescription
from fleet.model.place import Place
from fleet.model.schedule import ScheduleAnswer, ScheduleRequest, ScheduleState
from fleet.model.state import EdgeState, RobotState
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

ANSWER_WITHIN = 2.0  # s for answers from the memory of an edge
START_WITHIN = 15.0  # s for an edge to start a mission: its robots join the run first
HISTORY_WITHIN = 10.0  # s for answers that the edge reads from its disk
STARTED_WITHIN = 90.0  # s for a request to a schedule that may start a mission
START = "start one with: fleet run fleet.yaml (or: fleet demo)"

T = TypeVar("T")


class UnknownRobot(Refused):
    """No running edge has a robot or group of this name, or several edges have one."""


class Edges:
    """The reachable edges: all that run on this machine, or the one of a fleet file.

    ``joined`` names the edges that accepted a control session (``sessions``); ``unreached`` describes the
    running edges that did not.
    """

    def __init__(self, bus_sessions: Mapping[str, ZenohSession], unreached: list[str]) -> None:
        self.unreached = unreached
        self.joined = tuple(bus_sessions)
        self.sessions = tuple(bus_sessions.values())
        self._session_by_robot: dict[tuple[str, str], ZenohSession] = {}

    @classmethod
    def reach(cls, file: str | None) -> Self:
        """Join all edges concurrently; raises NotRunning if none can be joined."""
        wanted = _wanted(file)
        if not wanted:
            raise NotRunning(f"no edge is running here; {START}")
        with ThreadPoolExecutor(len(wanted)) as pool:
            joined = list(pool.map(lambda each: _joined(*each), wanted))
        found = [
            (settings.edge, bus_session) for (settings, _), bus_session in zip(wanted, joined, strict=True)
        ]
        bus_sessions = {
            edge: bus_session for edge, bus_session in found if isinstance(bus_session, ZenohSession)
        }
        unreached = [
            f"edge {edge}: {bus_session}"
            for edge, bus_session in found
            if not isinstance(bus_session, ZenohSession)
        ]
        if not bus_sessions:
            advice = "" if file else "; if it has a password, give its file: -f fleet.yaml"
            raise NotRunning("; ".join(unreached) + advice)
        return cls(bus_sessions, unreached)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for bus_session in self.sessions:
            bus_session.close()

    def states(self) -> list[RobotState]:
        """Return the states of the robots, by edge and name; the newest if several processes report one."""
        found: dict[tuple[str, str], RobotState] = {}
        for bus_session, _, state in self.request_all(keys.state("*", "*"), RobotState):
            robot = (state.edge, state.name)
            self._session_by_robot.setdefault(robot, bus_session)
            if robot not in found or state.stamp > found[robot].stamp:
                found[robot] = state
        return [found[robot] for robot in sorted(found)]

    def edges(self) -> list[EdgeState]:
        """Return the states of the edges, by name."""
        found = {state.edge: state for _, _, state in self.request_all(keys.health("*"), EdgeState)}
        return [found[edge] for edge in sorted(found)]

    def silent(self, found: Iterable[EdgeState]) -> list[str]:
        """Describe the joined edges that are not among those that answered."""
        answered = {state.edge for state in found}
        return [
            f"edge {edge} runs but does not answer: its event loop hangs"
            for edge in self.joined
            if edge not in answered
        ]

    def are_all(self, file: str | None) -> bool:
        """Return True if the edges that run now are the joined ones; always True for a fleet file."""
        return file is not None or {settings.edge for settings, _ in _wanted(None)} == set(self.joined)

    def named(self, name: str) -> list[RobotState]:
        """Return the robot of this name, or the robots of this group; raises UnknownRobot.

        ``edge/robot`` selects one of several robots with the same name.
        """
        states, edges = self.states(), self.edges()
        found = [state for state in states if name in (state.name, f"{state.edge}/{state.name}")]
        if len(found) > 1:  # in a pair, only the edge with the lease has the robot
            waiting = {edge.edge for edge in edges if edge.pair not in {"", "holder"}}
            found = [state for state in found if state.edge not in waiting] or found
        if len(found) > 1:
            which = ", ".join(f"{state.edge}/{state.name}" for state in found)
            raise UnknownRobot(f"there are several robots {name!r}", hint=f"say which one: {which}")
        found = found or _members(name, states, edges)
        if not found and any(name in edge.groups for edge in edges):
            raise UnknownRobot(f"the group {name!r} is empty: none of its robots runs")
        if not found:
            known = [state.name for state in states]
            near = nearest(name, [*known, *(group for edge in edges for group in edge.groups)])
            hints = [near or f"there are: {', '.join(known) or 'none'}", *self.unreached, *self.silent(edges)]
            raise UnknownRobot(f"there is no robot {name!r}", hint="; ".join(hints))
        return found

    def place(self, name: str, robots: Iterable[RobotState]) -> Place:
        """Return the place of this name, which must be equal on the edges of all robots; raises Refused."""
        wanted = {robot.edge for robot in robots}
        places = {edge.edge: edge.places for edge in self.edges() if edge.edge in wanted}
        found = [there[name] for there in places.values() if name in there]
        if len(found) == len(wanted) and all(place == found[0] for place in found):
            return found[0]
        if found:
            raise Refused(f"{name} is not the same place on {', '.join(sorted(wanted))}")
        known = sorted({place for there in places.values() for place in there})
        hint = nearest(name, known) or f"there are: {', '.join(known) or 'none; places: in fleet.yaml'}"
        raise Refused(f"there is no place {name!r}", hint=hint)

    def description(self, robot: RobotState) -> RobotDescription:
        """Return the vocabulary of a robot; raises TimedOut if its process does not answer."""
        for _, _, found in self.request_all(keys.description(robot.edge, robot.name), RobotDescription):
            return found
        raise TimedOut(f"{robot.name} does not report its commands: {robot.cause or 'its process is silent'}")

    def session_of(self, robot: RobotState) -> ZenohSession | None:
        """Return the bus session from which a robot's state came; None for a robot without a state."""
        return self._session_by_robot.get((robot.edge, robot.name))

    def command(
        self, robot: RobotState, payload: bytes, *, kind: str, wait: bool, timeout: float
    ) -> Iterator[Reply]:
        """Send a request to a robot at once; the result yields its receipt and, with ``wait``, its end."""
        bus_session = self.session_of(robot)
        if bus_session is None:
            return iter(())
        parameters = {"kind": kind, "wait": "1" if wait else "0"}
        key = keys.as_person(keys.command(robot.edge, robot.name), bus_session.person)
        answers = bus_session.request(key, payload, timeout=timeout, parameters=parameters)
        return (reply for _, reply in decoded(answers, Reply))

    def reload(self, edge: str, worker: str, adapter: str, *, within: float) -> Reply | None:
        """Ask a worker to reload the changed drop-in file of an adapter; return None without an answer."""
        key = keys.reload(edge, worker)
        requested = [
            bus_session.request(key, adapter.encode(), timeout=within) for bus_session in self.sessions
        ]
        return next((reply for answers in requested for _, reply in decoded(answers, Reply)), None)

    def schedules(self) -> list[tuple[str, ScheduleState]]:
        """Return the schedules of all edges, with their edge; raises Refused if an edge cannot read them."""
        requested = msgspec.json.encode(ScheduleRequest())
        found = []
        answers = self.request_all(
            keys.schedules("*"), ScheduleAnswer, requested, HISTORY_WITHIN, by_person=True
        )
        for _, key, answer in answers:
            if answer.refusal:
                raise Refused(f"edge {key.split('/')[1]}: {answer.refusal}")
            found += [(key.split("/")[1], state) for state in answer.schedules]
        return sorted(found, key=lambda pair: (pair[0], pair[1].name))

    def request_schedules(self, edge: str, requested: ScheduleRequest) -> ScheduleAnswer:
        """Send a request about an edge's schedules; raises TimedOut without an answer."""
        payload = msgspec.json.encode(requested)
        key = keys.schedules(edge)
        for _, _, answer in self.request_all(key, ScheduleAnswer, payload, STARTED_WITHIN, by_person=True):
            return answer
        raise TimedOut(f"edge {edge} does not answer for its schedules")

    def history(self, wanted: EventFilter) -> list[Record]:
        """Return the events of the edges' histories, oldest first."""
        requested = msgspec.json.encode(wanted)
        parts = self.request_all(keys.history("*"), list[Record], requested, HISTORY_WITHIN)
        by_edge = ((key.split("/")[1], record) for _, key, part in parts for record in part)
        return newest((msgspec.structs.replace(record, edge=edge) for edge, record in by_edge), wanted)

    def request(
        self,
        key: str,
        kind: type[T],
        requested: msgspec.Struct,
        parameters: Mapping[str, str] | None = None,
        *,
        within: float = START_WITHIN,
    ) -> T:
        """Send a request to one edge, over each session in turn; raises TimedOut without an answer."""
        payload = msgspec.json.encode(requested)
        for bus_session in self.sessions:
            to = keys.as_person(key, bus_session.person)
            for _, found in decoded(
                bus_session.request(to, payload, timeout=within, parameters=parameters), kind
            ):
                return found
        raise TimedOut(f"no answer within {within:g} s on {key}")

    def request_all(
        self,
        key: str,
        kind: type[T],
        payload: bytes = b"",
        within: float = ANSWER_WITHIN,
        *,
        by_person: bool = False,
    ) -> Iterator[tuple[ZenohSession, str, T]]:
        """Send a request on all sessions concurrently; yield each answer with its session and key.

        ``by_person``: add the name of the person in the session's certificate to the key.
        """
        requested = [
            (
                each,
                each.request(keys.as_person(key, each.person if by_person else ""), payload, timeout=within),
            )
            for each in self.sessions
        ]
        for bus_session, answers in requested:
            for answered, answer in decoded(answers, kind):
                yield bus_session, answered, answer


def decoded(answers: Iterator[tuple[str, bytes]], kind: type[T]) -> Iterator[tuple[str, T]]:
    """Yield the readable answers with their keys; an unreadable one must not hide the others."""
    for key, data in answers:
        try:
            yield key, decode_json(data, kind)
        except msgspec.DecodeError as error:
            log.warning("an answer on %s cannot be read: %s", key, error)


def _members(group: str, states: list[RobotState], edges: list[EdgeState]) -> list[RobotState]:
    """Return the robots of a group, including those without a state."""
    known = {(state.edge, state.name): state for state in states}
    return [
        known.get((edge.edge, name))
        or RobotState(name, "", "", edge.edge, 0.0, cause=f"it does not run on {edge.edge}")
        for edge in edges
        for name in edge.groups.get(group, ())
    ]


def _wanted(file: str | None) -> list[tuple[BusSettings, Path]]:
    """Return the bus settings and socket folder of the edge of a file, or of every edge that runs here.

    An edge with sockets in two folders is reached by the first, which belongs to this user.
    """
    running = {edge: path for path in reversed(client_dirs()) for edge in running_edges(path)}
    if file is None:
        return [(BusSettings(edge), running[edge]) for edge in sorted(running)]
    settings = settings_of(file)
    return [(settings, running.get(settings.edge) or client_dirs()[0])]


def _joined(settings: BusSettings, directory: Path) -> ZenohSession | BusError:
    """Join an edge's control session, or return the reason for the failure."""
    try:
        return join_control(settings, directory)
    except BusError as error:
        return error


def settings_of(file: str) -> BusSettings:
    """Return the bus settings of a fleet file's edge."""
    from fleet.config.load import sections_of  # noqa: PLC0415 - pydantic is not needed without a file
    from fleet.host.process.component_settings import bus_settings  # noqa: PLC0415

    return bus_settings(sections_of(file))


def site_of(file: str | None) -> str | None:
    """Return the site of a fleet file's edge; None without a file: that of the edges here."""
    if file is None:
        return None
    from fleet.config.load import sections_of  # noqa: PLC0415 - pydantic is not needed without a file

    return sections_of(file).edge.site or ""
