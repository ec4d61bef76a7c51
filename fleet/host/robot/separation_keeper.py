"""Separation keeper: keeps one robot apart from the others of its edge, before and during motion.

Its position and motion and those of the others, as far as this process knows them (``traffic``), are judged
by the rules of ``safety/separation.py``, ten times a second while this edge moves it. A new velocity is only
compared with the robots that were near at the last check.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import msgspec

from fleet.clock import Clock
from fleet.errors import CommandError, LinkError
from fleet.host.requests.event_reporter import EventReporter
from fleet.host.robot.measured_velocity import GAP, MeasuredVelocity
from fleet.host.safety.separation import (
    DEFAULT_BRAKING,
    Occupant,
    admitted,
    distance_since,
    free_speed,
    gap,
    must_brake,
    route_trouble,
    stopping,
)
from fleet.model.event import EventKind
from fleet.model.geodesy import GeoOrigin
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity, rotate_to_world
from fleet.model.navigation import AnyTask, FollowPath, FollowRobot
from fleet.model.site import Placement, placed_at_start
from fleet.robot_config import AdapterConfig, Limits, Separation

POLL_INTERVAL = 0.1  # s between checks of the others while it moves
STALE = 2 * POLL_INTERVAL  # s after which a check is too old for a velocity
JUDGED = 0.05  # s for which a judgement holds for similar velocities
ALIKE = 0.1  # m/s, and rad/s; velocities this close count as similar
JUMP = 1.0  # m beyond the possible distance that mean an odometry reset
SPEEDING_UP = 0.8  # m/s that an autopilot may have added since the last measurement
SAID = 1.0  # s for which a robot that was held counts as held
NO_LIMIT = 2.0  # m/s for a robot that declares no limit


class OtherRobots(Protocol):
    """Positions of the other robots of the edge, as far as this process knows them."""

    @property
    def alone(self) -> bool:
        """True on an edge with one robot: there are no others."""

    def place(self, world: GeoOrigin) -> Placement:
        """Return the placement of a world on Earth in the common frame."""

    def placements_changed(self) -> None:
        """Note that a robot has a first position, or lost its placement."""

    def others(self, name: str) -> Sequence[Occupant]:
        """Return all other robots whose position in this robot's frame is known."""

    def seen(self, name: str, other: str) -> Occupant | None:
        """Return another robot in this robot's frame; None when it is unknown."""

    def near(self, name: str, at: Vector3, reach: float) -> tuple[Occupant, ...]:
        """Return the others that may come near, by the distance that each may cover."""


class MovingRobot(Protocol):
    """Controller of the robot, as the keeper uses it."""

    @property
    def in_motion(self) -> bool:
        """True while the robot moves, or may move, because of this edge."""

    def current_task(self) -> tuple[AnyTask, int] | None:
        """Return the running task and the number of goals already reached."""

    def end(self, why: str) -> None:
        """End motion of this edge that must not go on."""

    def reapply_velocity(self) -> None:
        """Hold the requested velocity as far as the guard admits it now; raises the adapter's errors."""


class HoldNotice:
    """Reason why a robot is slowed or held, reported once; ``cause`` is empty while it is not."""

    def __init__(self, clock: Clock, event_reporter: EventReporter) -> None:
        self.cause = ""
        self._clock = clock
        self._event_reporter = event_reporter
        self._until = float("-inf")

    def say(self, what: str, robot: Occupant, other: Occupant) -> str:
        """Record that the robot is slowed or held because of another; return the text."""
        distance = (robot.at - other.at).norm()
        before, self.cause = self.cause, f"{what}: {distance:.1f} m from {other.name}, closing"
        self._until = self._clock.monotonic() + SAID
        if before.partition(":")[0] != what:
            fields = {"reason": self.cause, "robot": other.name, "distance_m": round(distance, 2)}
            self._event_reporter.event(EventKind.SEPARATION, self.cause, telemetry="separation", data=fields)
        return self.cause

    def expire(self) -> None:
        """Clear the cause once the robot has not been held for a while."""
        if self.cause and self._clock.monotonic() > self._until:
            self.cause = ""


class SeparationKeeper:
    """Separation of one robot from the others; ``separation`` is the default of its kind.

    ``led``: the host guides it to its goals by velocities. ``held`` returns the body velocity being held,
    ``points`` the points of a task in the robot's world.
    """

    __slots__ = (  # beyond 30 attributes, an instance without slots has a dictionary of 1.5 kB
        "_braking", "_clock", "_down", "_event_reporter", "_fastest", "_free", "_held", "_judged",
        "_judged_by", "_led", "_look_by", "_meant", "_mover", "_near", "_notice", "_points", "_radius",
        "_rank", "_reach", "_route", "_seen", "_share", "_start", "_task", "_usual", "_velocity", "_yaw",
        "at", "battery", "circle", "flies", "lost", "name", "on_earth", "others", "placement",
    )  # fmt: skip

    def __init__(
        self,
        config: AdapterConfig,
        separation: Separation,
        limits: Limits,
        *,
        clock: Clock,
        others: OtherRobots,
        mover: MovingRobot,
        led: bool,
        held: Callable[[], Velocity],
        points: Callable[[AnyTask], Sequence[Vector3]],
        event_reporter: EventReporter,
    ) -> None:
        self.name = config.name
        self.on_earth = False  # placed by its geodetic position, not by its start
        self.lost = ""  # why it is no longer placed
        self.placement: Placement | None = None
        self.at: Vector3 | None = None  # last position, in the common frame
        self.circle = 0.0  # m; radius at the end of a task, for a robot that cannot hover
        self.flies = False  # its motors run
        self._start = config.start
        self._usual = separation
        self.configure(config, limits)
        self._clock = clock
        self.others = others
        self._mover = mover
        self._led = led
        self._held = held
        self._points = points
        self._event_reporter = event_reporter
        self._notice = HoldNotice(clock, event_reporter)
        self.battery: float | None = None  # percent; of two equals the fuller one gives way
        self._yaw = 0.0
        self._seen = 0.0
        self._velocity = MeasuredVelocity()
        self._task: AnyTask | None = None
        self._route: tuple[Vector3, ...] = ()
        self._down: tuple[Vector3, ...] = ()  # path of a landing in progress
        self._meant: tuple[Vector3, ...] = ()  # path reserved for a prepared task
        self._near: tuple[tuple[float, Occupant], ...] = ()  # (metres free in any direction, robot)
        self._free = math.inf  # m/s admitted in any direction
        self._judged = ZERO_VELOCITY  # velocity judged last; its admitted share and expiry follow
        self._share = 1.0
        self._judged_by = float("-inf")
        self._look_by = float("-inf")

    @property
    def cause(self) -> str:
        """Why the robot is slowed or held; empty while it is not."""
        return self._notice.cause

    def configure(self, config: AdapterConfig, limits: Limits) -> None:
        """Apply a changed configuration from the next check on."""
        separation = config.separation.over(self._usual)
        self._radius = separation.radius or 1.0
        self._braking = separation.braking or DEFAULT_BRAKING
        self._rank = float(separation.precedence or 0)
        self._fastest = max(limits.speed or NO_LIMIT, limits.vertical_speed or 0.0)
        soon = self._fastest * 2 * STALE
        self._reach = self._radius + stopping(self._fastest, self._braking) + soon

    @property
    def is_judged(self) -> bool:
        """True when the robot is placed and there are others."""
        return self.placement is not None and not self.others.alone

    # -- position --------------------------------------------------------------------------------------

    def set_world_origin(self, world: GeoOrigin | None) -> None:
        """Place the robot by the geodetic origin of its world; None while that is unknown."""
        if world is not None and self._start is None:
            self.placement, self.on_earth = self.others.place(world), True

    def observe(self, pose: Pose) -> None:
        """Record the robot's pose in its own world."""
        now = self._clock.monotonic()
        if self.placement is None and self._start is not None and not self.lost:
            self.placement = placed_at_start(self._start, pose)
        if self.placement is None:
            return
        at = self.placement.to_site(pose.position)
        if self.at is not None and not self.on_earth:
            gone = (at - self.at).horizontal()
            if gone > JUMP + self._fastest * min(now - self._seen, GAP):
                self.lose_placement(f"its position jumped by {gone:.1f} m: its odometry began anew")
                return
        first = self.at is None
        self.at, self._seen, self._yaw = at, now, pose.rotation.yaw + self.placement.yaw
        self._velocity.observe(at, now)
        if first:
            self.others.placements_changed()

    def lose_placement(self, why: str) -> None:
        """Record that the robot is no longer placed, and why; others keep away from its last position."""
        self.lost, self.placement = why, None
        self.others.placements_changed()
        self._event_reporter.event(EventKind.SEPARATION, f"separation unknown: {why}", data={"reason": why})

    @property
    def reach(self) -> float:
        """Metres around its last position that it cannot leave before the next check and a full stop."""
        return (
            self._reach
            + 2 * self.circle
            + distance_since(self._velocity.value.norm(), self._clock.monotonic() - self._seen)
        )

    def occupant(self) -> Occupant | None:
        """Return the robot's present occupant; None while its position is unknown."""
        if self.at is None:
            return None
        held, route = self._held(), self._ahead()
        requested, turn = rotate_to_world(held.linear, self._yaw), held.yaw_rate
        if route and not self._led:
            # only the magnitude counts
            requested = Vector3(min(self._fastest, self._velocity.value.norm() + SPEEDING_UP))
        return Occupant(
            self.name,
            self._radius + (self.circle if route else 2 * self.circle * self.flies),
            self._braking,
            self.at,
            route,
            self._velocity.value,
            requested,
            turn,
            self._clock.monotonic() - self._seen,
            self._mover.in_motion,
            (self._rank, -100.0 if self.battery is None else -self.battery),
        )

    def _ahead(self) -> tuple[Vector3, ...]:
        """Return the remaining path of the present task."""
        doing = self._mover.current_task()
        if self.placement is None:
            return ()
        if doing is None:
            return self._down or self._meant
        task, behind = doing
        if task is not self._task:
            self._task = task
            self._route = self._in_site(self._points(task))
        once = isinstance(task, FollowPath) and task.loops == 1
        return self._route[behind:] if once else self._route

    def _in_site(self, points: Sequence[Vector3]) -> tuple[Vector3, ...]:
        """Return points of the robot's world in the common frame."""
        assert self.placement is not None
        return tuple(map(self.placement.to_site, points))

    # -- checks of requests ----------------------------------------------------------------------------

    def task_trouble(self, task: AnyTask, points: Sequence[Vector3]) -> str:
        """Return why the robot may not be sent through these points of its world; empty when it may."""
        robot = self.occupant()
        if robot is None or self.placement is None:
            return ""
        route = self._in_site(points)
        robot = msgspec.structs.replace(robot, radius=self._radius + self.circle)
        trouble = route_trouble(robot, route, self.others.others(self.name))
        if not trouble:
            self._task, self._route = task, route
        return trouble

    def trouble_on(self, points: Sequence[Vector3]) -> str:
        """Return the conflict on a path that is not refused for it; empty for none."""
        robot = self.occupant()
        if robot is None or self.placement is None or not points:
            return ""
        return route_trouble(robot, self._in_site(points), self.others.others(self.name))

    def reserve_path(self, points: Sequence[Vector3]) -> None:
        """Reserve the path of a prepared task; no points release it."""
        self._meant = self._in_site(points) if self.placement is not None else ()

    def reserve_landing(self, points: Sequence[Vector3]) -> None:
        """Reserve the path of a landing; no points release it."""
        self._down = self._in_site(points) if self.placement is not None else ()

    def limited_velocity(self, velocity: Velocity) -> Velocity:
        """Return a body velocity, slowed so far that the robot can stop before it is too near another.

        Most velocities pass by a comparison; of the others, one judgement serves all similar ones.
        """
        now = self._clock.monotonic()
        if now > self._look_by:
            self._look_around()
        if self._free == math.inf or velocity.linear.norm() <= self._free:
            return velocity
        if now > self._judged_by or not _is_close(velocity, self._judged):
            self._judge(velocity)
            self._judged, self._judged_by = velocity, now + JUDGED
        if self._share == 1.0:
            return velocity
        return Velocity(velocity.linear.scaled(self._share), velocity.yaw_rate, velocity.gait)

    def _judge(self, velocity: Velocity) -> None:
        """Find the share of a velocity that keeps the robot apart from those nearby."""
        self._share = 1.0
        robot = self.occupant()
        if robot is None:
            return
        robot = msgspec.structs.replace(robot, turn=velocity.yaw_rate)
        wanted, whose = rotate_to_world(velocity.linear, self._yaw), robot
        fastest = max(wanted.norm(), robot.speed)
        metres = stopping(fastest, self._braking) + fastest * STALE
        for free, other in self._near:
            if free < metres and (share := admitted(robot, wanted, other)) < self._share:
                self._share, whose = share, other
        if self._share < 1.0:
            self._notice.say("slowed" if self._share else "held", robot, whose)

    # -- during motion ---------------------------------------------------------------------------------

    def check(self) -> None:
        """Check the robots nearby while this edge moves the robot; slow it, or end its motion."""
        self._notice.expire()
        if not self._mover.in_motion:
            return
        self._look_around()
        try:
            self._keep_apart()
        except (CommandError, LinkError) as error:
            self._mover.end(f"it could not be slowed: {error}")

    def _keep_apart(self) -> None:
        """Slow the velocity that is held; end an autopilot's task that comes too near another robot."""
        if not self._near:
            return
        doing = self._mover.current_task()
        led = doing is not None and (self._led or isinstance(doing[0], FollowRobot))
        if led or not self._held().is_zero:
            self._mover.reapply_velocity()
            return
        robot = self.occupant()
        for _, other in self._near:
            if robot is not None and must_brake(robot, other):
                self._mover.end(self._notice.say("held", robot, other))
                return

    def _look_around(self) -> None:
        """Find the robots near enough to be met before the next check."""
        self._look_by = self._clock.monotonic() + STALE
        self._judged_by, self._near, self._free = float("-inf"), (), math.inf
        if self.at is None:
            return
        near = self.others.near(self.name, self.at, self.reach)
        if near and (robot := self.occupant()) is not None:
            self._near = tuple((gap(robot, other, STALE), other) for other in near)
            least = min(free for free, _ in self._near)
            self._free = free_speed(least, self._braking, STALE)


def _is_close(one: Velocity, other: Velocity) -> bool:
    """Return whether two velocities are similar enough to share a judgement."""
    return abs(one.yaw_rate - other.yaw_rate) <= ALIKE and (one.linear - other.linear).norm() <= ALIKE
