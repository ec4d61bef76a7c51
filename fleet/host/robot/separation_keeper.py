"""Keeps one robot apart from the others of its edge: goals before they begin, motion as it happens.

Its own place and motion, and those of the others as far as this process knows them (``traffic``), are judged
by the rules of ``safety/separation.py``. Ten times a second while something of ours moves it; a velocity on
its way is only compared with who was near at the last look.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import msgspec

from fleet.clock import Clock
from fleet.errors import CommandError, LinkError
from fleet.host.requests.event_reporter import EventReporter
from fleet.host.safety.separation import (
    Occupant,
    admitted,
    free_speed,
    gap,
    gone_since,
    must_brake,
    stopping,
    way_trouble,
)
from fleet.model.event import EventKind
from fleet.model.geodesy import GeoOrigin
from fleet.model.geometry import ZERO_VELOCITY, Pose, Vector3, Velocity, rotate_to_world
from fleet.model.navigation import AnyTask, FollowPath, FollowRobot
from fleet.model.site import Placement, placed_at_start
from fleet.robot_config import AdapterConfig, Limits, Separation

LOOK = 0.1  # s between looks at the others while it moves
STALE = 2 * LOOK  # s after which a look is too old for a velocity
JUDGED = 0.05  # s for which what was found of a velocity is so of those that are alike
ALIKE = 0.1  # m/s, and rad/s
MEASURED = 0.2  # s of way that make a speed
GAP = 1.0  # s without a pose after which what lies between says nothing of its speed
JUMP = 1.0  # m beyond what it can have gone that mean that its odometry began anew
SPEEDING_UP = 0.8  # m/s that a robot which leads itself may have gained since it was measured
SAID = 1.0  # s for which a robot that was held counts as held
NO_LIMIT = 2.0  # m/s for a robot that declares no limit


class OtherRobots(Protocol):
    """Where the other robots of the edge are, as far as a process knows."""

    @property
    def alone(self) -> bool:
        """True on an edge of one robot: there is nothing to keep it apart from."""

    def place(self, world: GeoOrigin) -> Placement:
        """Return where a world on Earth lies in the frame that is judged in."""

    def others(self, name: str) -> Sequence[Occupant]:
        """Return all robots but one whose place is known in the frame of that one."""

    def seen(self, name: str, other: str) -> Occupant | None:
        """Return a robot in the frame of one; None where nobody knows."""

    def near(self, name: str, at: Vector3, reach: float) -> tuple[Occupant, ...]:
        """Return those of them that may be met before long, by how far each may go."""


class MovingRobot(Protocol):
    """What moves the robot: its controller."""

    @property
    def in_motion(self) -> bool:
        """True while the robot moves, or may move, because of us."""

    def doing(self) -> tuple[AnyTask, int] | None:
        """Return the task under way, and how many of its goals are behind."""

    def end(self, why: str) -> None:
        """End motion of ours that must not go on."""

    def hold_again(self) -> None:
        """Hold the wanted velocity as far as the guard lets it pass now; raises what the adapter raises."""


class HoldNotice:
    """Why a robot does not go as it was asked, told once; ``cause`` is empty while it does."""

    def __init__(self, clock: Clock, event_reporter: EventReporter) -> None:
        self.cause = ""
        self._clock = clock
        self._event_reporter = event_reporter
        self._until = float("-inf")

    def say(self, what: str, robot: Occupant, other: Occupant) -> str:
        """Note that the robot is slowed or held because of another; return it in words."""
        distance = (robot.at - other.at).norm()
        before, self.cause = self.cause, f"{what}: {distance:.1f} m from {other.name}, closing"
        self._until = self._clock.monotonic() + SAID
        if before.partition(":")[0] != what:
            fields = {"reason": self.cause, "robot": other.name, "distance_m": round(distance, 2)}
            self._event_reporter.event(EventKind.SEPARATION, self.cause, telemetry="separation", data=fields)
        return self.cause

    def expire(self) -> None:
        """Forget why it was held, once it has not been for a while."""
        if self.cause and self._clock.monotonic() > self._until:
            self.cause = ""


class MeasuredVelocity:
    """The velocity of a robot (``value``, m/s) from where it was seen."""

    def __init__(self) -> None:
        self.value = Vector3()
        self._at = Vector3()
        self._time = 0.0

    def see(self, at: Vector3, now: float) -> None:
        """Take where it is; the velocity is measured over a few looks."""
        elapsed = now - self._time
        if elapsed < MEASURED:
            return
        self.value = (at - self._at).scaled(1 / elapsed) if elapsed <= GAP else Vector3()
        self._at, self._time = at, now


class SeparationKeeper:
    """One robot among the others; ``separation`` holds where its configuration says nothing.

    ``led``: the host leads it to its goals, by velocities. ``held`` tells the body velocity that is being
    held, ``points`` the places of a task in the robot's world.
    """

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
        self.on_earth = False  # placed by its place on Earth, not by where it started
        self.lost = ""  # why it is not placed any more
        self.placement: Placement | None = None
        self.at: Vector3 | None = None  # where it was last, in the frame that is judged in
        self.circle = 0.0  # m about its end in which it stays that cannot stand
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
        self.battery: float | None = None  # percent: of two alike the fuller one gives way
        self._yaw = 0.0
        self._seen = 0.0
        self._velocity = MeasuredVelocity()
        self._task: AnyTask | None = None
        self._way: tuple[Vector3, ...] = ()
        self._down: tuple[Vector3, ...] = ()  # the way of a landing that is under way
        self._meant: tuple[Vector3, ...] = ()  # the way that it is prepared for
        self._near: tuple[tuple[float, Occupant], ...] = ()  # by how far the robot may go in any direction
        self._free = math.inf  # m/s that pass in any direction
        self._judged = ZERO_VELOCITY  # the velocity that was judged last, and what of it passes until when
        self._share = 1.0
        self._judged_by = float("-inf")
        self._look_by = float("-inf")

    @property
    def cause(self) -> str:
        """Why the robot does not go as it was asked; empty while it does."""
        return self._notice.cause

    def configure(self, config: AdapterConfig, limits: Limits) -> None:
        """Keep the others away by another configuration from the next look on."""
        separation = config.separation.over(self._usual)
        self._radius = separation.radius or 1.0
        self._braking = separation.braking or 0.5
        self._rank = float(separation.precedence or 0)
        self._fastest = max(limits.speed or NO_LIMIT, limits.vertical_speed or 0.0)
        soon = self._fastest * 2 * STALE
        self._reach = self._radius + stopping(self._fastest, self._braking) + soon

    @property
    def is_judged(self) -> bool:
        """True when the robot is placed, and has others to be kept apart from."""
        return self.placement is not None and not self.others.alone

    # -- where it is -----------------------------------------------------------------------------------

    def world_is(self, world: GeoOrigin | None) -> None:
        """Take the place on Earth of the origin of the robot's world; None while nobody knows it."""
        if world is not None and self._start is None:
            self.placement, self.on_earth = self.others.place(world), True

    def see(self, pose: Pose) -> None:
        """Take where the robot is in its own world."""
        now = self._clock.monotonic()
        if self.placement is None and self._start is not None and not self.lost:
            self.placement = placed_at_start(self._start, pose)
        if self.placement is None:
            return
        at = self.placement.to_site(pose.position)
        if self.at is not None and not self.on_earth and self._has_jumped(at, now):
            return
        self.at, self._seen, self._yaw = at, now, pose.rotation.yaw + self.placement.yaw
        self._velocity.see(at, now)

    def _has_jumped(self, at: Vector3, now: float) -> bool:
        """Return whether it can not have come there: then nobody knows where it is."""
        assert self.at is not None
        gone = (at - self.at).horizontal()
        if gone <= JUMP + self._fastest * min(now - self._seen, GAP):
            return False
        self.lost = f"its position jumped by {gone:.1f} m: its odometry began anew"
        self.placement = None
        unknown = {"reason": self.lost}
        self._event_reporter.event(EventKind.SEPARATION, f"separation unknown: {self.lost}", data=unknown)
        return True

    @property
    def reach(self) -> float:
        """Metres around its last place that it cannot leave before it is looked at again and stands."""
        return (
            self._reach
            + 2 * self.circle
            + gone_since(self._velocity.value.norm(), self._clock.monotonic() - self._seen)
        )

    def occupant(self) -> Occupant | None:
        """Return what the robot takes up now, None while nobody knows where it is."""
        if self.at is None:
            return None
        held, way = self._held(), self._ahead()
        asked, turn = rotate_to_world(held.linear, self._yaw), held.yaw_rate
        if way and not self._led:
            # Its size alone counts.
            asked = Vector3(min(self._fastest, self._velocity.value.norm() + SPEEDING_UP))
        return Occupant(
            self.name,
            self._radius + (self.circle if way else 2 * self.circle * self.flies),
            self._braking,
            self.at,
            way,
            self._velocity.value,
            asked,
            turn,
            self._clock.monotonic() - self._seen,
            self._mover.in_motion,
            (self._rank, -100.0 if self.battery is None else -self.battery),
        )

    def _ahead(self) -> tuple[Vector3, ...]:
        """Return the rest of the way that it is sent."""
        doing = self._mover.doing()
        if self.placement is None:
            return ()
        if doing is None:
            return self._down or self._meant
        task, behind = doing
        if task is not self._task:
            self._task = task
            self._way = self._in_site(self._points(task))
        once = isinstance(task, FollowPath) and task.loops == 1
        return self._way[behind:] if once else self._way

    def _in_site(self, points: Sequence[Vector3]) -> tuple[Vector3, ...]:
        """Return points of the robot's world in the frame that is judged in."""
        assert self.placement is not None
        return tuple(map(self.placement.to_site, points))

    # -- what may be asked of it -----------------------------------------------------------------------

    def task_trouble(self, task: AnyTask, points: Sequence[Vector3]) -> str:
        """Return why the robot may not be sent through these points of its world, empty when it may."""
        robot = self.occupant()
        if robot is None or self.placement is None:
            return ""
        way = self._in_site(points)
        robot = msgspec.structs.replace(robot, radius=self._radius + self.circle)
        trouble = way_trouble(robot, way, self.others.others(self.name))
        if not trouble:
            self._task, self._way = task, way
        return trouble

    def trouble_on(self, points: Sequence[Vector3]) -> str:
        """Return what is met on a way that is taken all the same, empty for nothing."""
        robot = self.occupant()
        if robot is None or self.placement is None or not points:
            return ""
        return way_trouble(robot, self._in_site(points), self.others.others(self.name))

    def means(self, points: Sequence[Vector3]) -> None:
        """Note the way that the robot is prepared for, which others keep away from; no points: none."""
        self._meant = self._in_site(points) if self.placement is not None else ()

    def comes_down(self, points: Sequence[Vector3]) -> None:
        """Note the way of a landing, which others keep away from; no points: it has ended."""
        self._down = self._in_site(points) if self.placement is not None else ()

    def within(self, velocity: Velocity) -> Velocity:
        """Return a body velocity, slowed so far that the robot can stop before it is too near another.

        Most pass by a comparison; of those that do not, one is judged for all that are much like it.
        """
        now = self._clock.monotonic()
        if now > self._look_by:
            self._look_around()
        if self._free == math.inf or velocity.linear.norm() <= self._free:
            return velocity
        if now > self._judged_by or not _alike(velocity, self._judged):
            self._judge(velocity)
            self._judged, self._judged_by = velocity, now + JUDGED
        if self._share == 1.0:
            return velocity
        return Velocity(velocity.linear.scaled(self._share), velocity.yaw_rate, velocity.gait)

    def _judge(self, velocity: Velocity) -> None:
        """Find what share of a velocity keeps the robot apart from those who are near."""
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

    # -- as it moves -----------------------------------------------------------------------------------

    def look(self) -> None:
        """Look at who is near while something of ours moves the robot; slow it, or end its motion."""
        self._notice.expire()
        if not self._mover.in_motion:
            return
        self._look_around()
        try:
            self._keep_apart()
        except (CommandError, LinkError) as error:
            self._mover.end(f"it could not be slowed: {error}")

    def _keep_apart(self) -> None:
        """Slow the velocity that is held; end a way that its autopilot flies too near another."""
        if not self._near:
            return
        doing = self._mover.doing()
        led = doing is not None and (self._led or isinstance(doing[0], FollowRobot))
        if led or not self._held().is_zero:
            self._mover.hold_again()
            return
        robot = self.occupant()
        for _, other in self._near:
            if robot is not None and must_brake(robot, other):
                self._mover.end(self._notice.say("held", robot, other))
                return

    def _look_around(self) -> None:
        """Note who is so near that the robot could meet it before the next look."""
        self._look_by = self._clock.monotonic() + STALE
        self._judged_by, self._near, self._free = float("-inf"), (), math.inf
        if self.at is None:
            return
        near = self.others.near(self.name, self.at, self.reach)
        if near and (robot := self.occupant()) is not None:
            self._near = tuple((gap(robot, other, STALE), other) for other in near)
            least = min(free for free, _ in self._near)
            self._free = free_speed(least, self._braking, STALE)


def _alike(one: Velocity, other: Velocity) -> bool:
    """Return whether two velocities lead to the same place, as far as it matters here."""
    return abs(one.yaw_rate - other.yaw_rate) <= ALIKE and (one.linear - other.linear).norm() <= ALIKE
