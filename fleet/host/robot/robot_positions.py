"""Positions of the robots of an edge and of its partners, as far as one process knows them.

Each process judges the motion of its own robots against all others. Positions from other processes, of this
edge or of a partner, arrive over the bus ten times a second. The robots of a silent process stay at their
last position; the distance that they may have covered since is part of the judgement.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Mapping
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.config.schema import FleetConfig
from fleet.host.robot.separation_keeper import SeparationKeeper
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.host.safety.separation import Occupant, stopping
from fleet.model.geodesy import GeoOrigin
from fleet.model.geometry import Vector3
from fleet.model.site import Placement, placed_on_earth
from fleet.robot_config import MAIN
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

TELL = 0.1  # s between messages to other processes
MOST_NAMED = 8  # robots that are named where the distance from others is unknown
SPEEDING_UP = 1.0  # m that a robot of another process may be nearer than its last speed implies


class _ReportedRobot(msgspec.Struct, frozen=True):
    """A robot of another process; ``on_earth``: placed by geodetic position; ``lost``: no longer placed."""

    robot: Occupant
    on_earth: bool
    lost: bool = False


class _PositionsMessage(msgspec.Struct, frozen=True):
    """Message of a process about its robots; ``anchor``: the origin of those on Earth, None without any.

    ``located``: the anchor is the origin of the site, so all of its robots are on Earth. ``gone``: robots
    that the process no longer has.
    """

    robots: tuple[_ReportedRobot, ...]
    anchor: GeoOrigin | None = None
    located: bool = False
    gone: tuple[str, ...] = ()


class RobotPositions:
    """Robots of one edge and of its partners, in the site's frame.

    ``names`` are all robots of ``edge``; ``partners`` maps the names of the others to their edges. Without a
    site origin, robots on Earth have a frame of their own, around the first known one, and their distance
    from the other robots is unknown.
    """

    def __init__(
        self,
        site: GeoOrigin | None,
        names: Iterable[str],
        clock: Clock,
        *,
        edge: str = "",
        partners: Mapping[str, str] | None = None,
    ) -> None:
        self.edge = edge
        self._edges = {**(partners or {}), **dict.fromkeys(names, edge)}
        self._clock = clock
        self._site = site
        self._anchor = site
        self._own: dict[str, SeparationKeeper] = {}
        self._reported: dict[str, tuple[float, _ReportedRobot]] = {}
        self._reporters: dict[str, str] = {}  # process that reported a robot last
        self._gone: set[str] = set()
        self._hidden: dict[str, list[str]] = {}  # by frame: the robots that are not in it, or lost

    @property
    def alone(self) -> bool:
        """True for one robot without others, here or at a partner."""
        return len(self._edges) < 2

    @property
    def edges(self) -> frozenset[str]:
        """This edge and its partners."""
        return frozenset({self.edge, *self._edges.values()})

    def join(self, robot: SeparationKeeper) -> None:
        """Add a robot of this process, and share its position with the other processes."""
        self._own[robot.name] = robot
        self.expect(robot.name)

    def expect(self, name: str) -> None:
        """Add a robot of this edge, in any process, that is not placed yet."""
        self._edges[name] = self.edge
        self._gone.discard(name)
        self.placements_changed()

    def leave(self, name: str) -> None:
        """Remove a robot from this edge, also in its other processes."""
        for table in (self._own, self._reported, self._edges, self._reporters):
            table.pop(name, None)
        self._gone.add(name)
        self.placements_changed()

    def placements_changed(self) -> None:
        """Note that a robot has a first position, lost its placement, or came or went."""
        self._hidden.clear()

    def place(self, world: GeoOrigin) -> Placement:
        """Return the placement of a world on Earth; the first such world becomes the origin."""
        if self._anchor is None:
            self._anchor = world
        return placed_on_earth(self._anchor, world)

    def one(self, name: str) -> Occupant | None:
        """Return a robot's present occupant; None while its position is unknown."""
        if name in self._own:
            return self._own[name].occupant()
        if name not in self._reported:
            return None
        since, reported = self._reported[name]
        return msgspec.structs.replace(
            reported.robot, age=reported.robot.age + self._clock.monotonic() - since
        )

    def others(self, name: str) -> list[Occupant]:
        """Return all other robots whose position in this robot's frame is known."""
        frame = self._frame(name)
        there = (self.one(other) for other in self._edges if other != name and self._frame(other) == frame)
        return [robot for robot in there if robot is not None]

    def seen(self, name: str, other: str) -> Occupant | None:
        """Return another robot in this robot's frame; None when it is unknown."""
        frame = self._frame(name)
        return self.one(other) if frame and self._frame(other) == frame else None

    def near(self, name: str, at: Vector3, reach: float) -> tuple[Occupant, ...]:
        """Return the other robots that may come near, by the distance that each of the two may cover."""
        frame = self._frame(name)
        found = []
        for other, own in self._own.items():
            if own.at is not None and other != name and (at - own.at).norm() <= reach + own.reach:
                found.append(other)
        found += [other for other in self._reported if other != name]
        there = (self.one(other) for other in found if self._frame(other) == frame)
        return tuple(robot for robot in there if robot is not None and _may_meet(robot, at, reach))

    def _frame(self, name: str) -> str:
        """Return the frame that a robot is placed in; empty for none."""
        own = self._own.get(name)
        if own is not None:
            placed, on_earth = own.at is not None, own.on_earth
        else:
            placed = name in self._reported
            on_earth = placed and self._reported[name][1].on_earth
        if not placed:
            return ""
        return "earth" if on_earth and self._site is None else "site"

    def in_site(self, name: str) -> SeparationKeeper | None:
        """Return a robot of this process; None unless it is placed in the site's frame."""
        robot = self._own.get(name)
        if robot is None or robot.placement is None or self._frame(name) != "site":
            return None
        return robot

    def unknown(self, name: str) -> str:
        """Return why a robot's distance from others is unknown; empty when all are known."""
        own = self._own.get(name)
        if own is None or self.alone:
            return ""
        if own.lost:
            return f"unknown: {own.lost}"
        frame = self._frame(name)
        if not frame:
            placed = own.placement is not None
            return "unknown: " + ("it has not reported its position" if placed else "it is not placed")
        hidden = self._hidden_from(frame)
        more = f" and {len(hidden) - MOST_NAMED} more" if len(hidden) > MOST_NAMED else ""
        return f"unknown to {', '.join(hidden[:MOST_NAMED])}{more}" if hidden else ""

    def _hidden_from(self, frame: str) -> list[str]:
        """Return the robots that are not in a frame, or lost: the same for all that are in it.

        It is kept until a placement changes: every robot reports it every second.
        """
        if frame not in self._hidden:
            self._hidden[frame] = [
                other for other in self._edges if self._frame(other) != frame or self._is_lost(other)
            ]
        return self._hidden[frame]

    def _is_lost(self, name: str) -> bool:
        """Return whether a robot was placed and no longer is."""
        if name in self._own:
            return bool(self._own[name].lost)
        return name in self._reported and self._reported[name][1].lost

    # -- between processes -----------------------------------------------------------------------------

    def positions_message(self) -> bytes:
        """Return the message for other processes about this process's robots."""
        robots = [
            _ReportedRobot(occupant, robot.on_earth, bool(robot.lost))
            for robot in self._own.values()
            if (occupant := robot.occupant()) is not None
        ]
        gone = tuple(sorted(self._gone))
        return msgspec.json.encode(
            _PositionsMessage(tuple(robots), self._anchor, self._site is not None, gone)
        )

    def receive(self, payload: bytes, edge: str, process: str = "") -> None:
        """Process the message of another process of this edge or of a partner; on the event loop.

        A partner's robot that is not on Earth is in an unrelated frame and stays unknown. An unknown robot of
        this edge was added while it runs.
        """
        try:
            sheet = decode_json(payload, _PositionsMessage)
        except msgspec.DecodeError as error:
            log.warning("positions of robots from edge %s cannot be read: %s", edge, error)
            return
        now = self._clock.monotonic()
        self.placements_changed()
        placement = None if sheet.anchor is None else self.place(sheet.anchor)
        for reported in sheet.robots:
            name, on_earth = reported.robot.name, reported.on_earth or sheet.located
            known = self._edges.get(name, self.edge)
            if name in self._own or known != edge or not (on_earth or edge == self.edge):
                continue
            self._edges[name], self._reporters[name] = edge, process
            self._reported[name] = (
                now,
                _moved(msgspec.structs.replace(reported, on_earth=on_earth), placement),
            )
        for name in sheet.gone if edge == self.edge else ():
            if process == MAIN or self._reporters.get(name) == process:  # the edge's own process knows of all
                for table in (self._reported, self._reporters, self._edges):
                    table.pop(name, None)


def _may_meet(robot: Occupant, at: Vector3, reach: float) -> bool:
    """Return whether a robot may soon meet one that moves at most ``reach`` metres from ``at``."""
    theirs = (
        robot.radius + robot.uncertainty + stopping(robot.speed, robot.braking) + robot.speed + SPEEDING_UP
    )
    return (at - robot.at).norm() <= reach + theirs


def _moved(reported: _ReportedRobot, placement: Placement | None) -> _ReportedRobot:
    """Return a robot of another process, converted into our frame."""
    if not reported.on_earth or placement is None or placement == Placement():
        return reported
    robot = reported.robot
    moved = msgspec.structs.replace(
        robot, at=placement.to_site(robot.at), route=tuple(map(placement.to_site, robot.route))
    )
    return msgspec.structs.replace(reported, robot=moved)


def positions_of(config: FleetConfig, clock: Clock) -> RobotPositions:
    """Return the robots of a fleet file and of its partners, none of them placed yet."""
    origin = config.site.origin
    return RobotPositions(
        GeoOrigin(*origin) if origin else None,
        (robot.name for robot in config.robots),
        clock,
        edge=config.edge.id,
        partners=partner_robots(config),
    )


def partner_robots(config: FleetConfig) -> dict[str, str]:
    """Return the edges of the partners' robots, by robot name."""
    return {robot: edge for edge, partner in config.partners.items() for robot in partner.robots}


def exchange(traffic: RobotPositions, process: str, control: ZenohSession, scheduler: TickScheduler) -> None:
    """Exchange robot positions with the other processes of this edge and with its partners."""
    loop, publisher = asyncio.get_running_loop(), control.publisher(keys.positions(traffic.edge, process))

    def heard(edge: str, key: str, payload: bytes) -> None:
        loop.call_soon_threadsafe(traffic.receive, payload, edge, key.rpartition("/")[2])

    def tell() -> None:
        if publisher.wanted:
            publisher.put(traffic.positions_message())

    for edge in sorted(traffic.edges):
        control.subscribe(keys.positions(edge, "*"), partial(heard, edge))
    scheduler.every(TELL, tell)
