"""Navigation to goals by the autopilot's own position control: targets, and supervision of the flight."""

from __future__ import annotations

import itertools
import math
from collections.abc import AsyncIterator

import msgspec

from fleet import (
    CommandError,
    Constraints,
    FollowPath,
    GeoOrigin,
    GeoPoint,
    Goal,
    GoTo,
    Limits,
    NotReady,
    Progress,
    Refused,
    RelativeMove,
    TimedOut,
    Unsupported,
    Vector3,
    geo_from_world,
    heading_from_enu_yaw,
    rotate_to_world,
    world_from_geo,
    wrap_angle,
)
from fleet_mavlink.flight import FARTHEST, Flight
from fleet_mavlink.motion_effect import effect_of_descent
from fleet_mavlink.preconditions import (
    home_unknown,
    is_standing,
    known_heading,
    known_position,
    not_armed,
    require_connection,
    require_has,
    require_movable,
)
from fleet_mavlink.state import VehicleState
from fleet_mavlink.takeoff import TakeOff
from fleet_mavlink.vocabulary import ON_WINGS
from fleet_mavlink.wings import Winged
from fleet_mavlink.world_frame import pose_of

_YAW_TOLERANCE = 0.2  # rad
_POLL = 0.5  # s between checks
_STUCK_AFTER = 5.0  # s without progress
_GIVE_UP_AFTER = 30.0  # s
_NEARER = 0.25  # m, or rad of turn, that counts as progress
_MOST_GOALS = 1000
_ALONG = 0.01  # m of sideways motion that is ignored

RouteTask = GoTo | FollowPath | RelativeMove


class NavigationTarget(msgspec.Struct, frozen=True):
    """One goal made concrete: altitude AMSL, ``heading`` radians from north (None: kept), ``wait`` s.

    ``backwards``: a vehicle that moves along its nose drives in reverse. ``level``: ignore the height.
    """

    point: GeoPoint
    heading: float | None
    wait: float
    backwards: bool = False
    level: bool = False


def targets_of(task: RouteTask, state: VehicleState, origin: GeoOrigin) -> tuple[NavigationTarget, ...]:
    """Return the positions of a task, in order; raises Refused for an invalid task."""
    if isinstance(task, GoTo):
        return (_target(task.goal, origin),)
    if isinstance(task, FollowPath):
        if not task.goals or not 1 <= task.loops * len(task.goals) <= _MOST_GOALS:
            raise Refused(f"a path has 1 to {_MOST_GOALS} goals, loops counted")
        return tuple(_target(goal, origin) for goal in task.goals) * task.loops
    moved = _target(Goal(position=_moved(task, state, origin)), origin)
    return (msgspec.structs.replace(moved, backwards=task.body_frame and task.translation.x < 0.0),)


def _target(goal: Goal, origin: GeoOrigin) -> NavigationTarget:
    """Return the position of a goal on Earth; raises Refused for an implausible one."""
    if goal.position is not None and goal.position.horizontal() > FARTHEST:
        raise Refused(
            f"the goal is more than {FARTHEST / 1000:g} km away from the origin; it counts in metres"
        )
    point = goal.geo or geo_from_world(origin, goal.position or Vector3())
    numbers = (point.latitude, point.longitude, point.altitude, goal.yaw or 0.0, goal.wait)
    if not all(map(math.isfinite, numbers)) or not abs(point.latitude) < 90:
        raise Refused("a goal must be made of finite numbers on Earth")
    heading = None
    if goal.yaw is not None:
        heading = (heading_from_enu_yaw(goal.yaw) + math.radians(origin.heading)) % math.tau
    return NavigationTarget(point, heading, max(0.0, goal.wait))


def _moved(move: RelativeMove, state: VehicleState, origin: GeoOrigin) -> Vector3:
    """Return the end of a relative move in the world frame; raises NotReady without a position."""
    pose = pose_of(state, origin)
    if pose is None:
        raise NotReady("position or attitude is unknown")
    step = rotate_to_world(move.translation, pose.rotation.yaw) if move.body_frame else move.translation
    return pose.position + step


def _distance(one: GeoPoint, other: GeoPoint) -> float:
    """Return the distance between two positions, m."""
    return _offset(one, other).norm()


def _offset(one: GeoPoint, other: GeoPoint) -> Vector3:
    """Return the vector from one position to another, metres east, north, up."""
    return world_from_geo(GeoOrigin(one.latitude, one.longitude, one.altitude), other)


def _require_along(task: RouteTask) -> None:
    """Raise Refused for a task that needs more than motion along the nose."""
    goals = (task.goal,) if isinstance(task, GoTo) else task.goals if isinstance(task, FollowPath) else ()
    if any(goal.yaw is not None for goal in goals):
        raise Refused(
            "it arrives with the heading of its path: it cannot turn to a yaw at a goal",
            hint="leave the yaw out",
        )
    if not isinstance(task, RelativeMove):
        return
    if abs(task.translation.z) > _ALONG:
        raise Refused("it moves on the surface: its height is not its own")
    if task.body_frame and abs(task.translation.y) > _ALONG:
        raise Refused("it moves along its nose, ahead or back, and not sideways", hint="send a goal")


def _require_circled(task: RouteTask) -> None:
    """Raise Refused or Unsupported for a task that needs more than circling positions."""
    if isinstance(task, RelativeMove):
        raise Unsupported(ON_WINGS)
    goals = (task.goal,) if isinstance(task, GoTo) else task.goals
    if any(goal.yaw is not None for goal in goals):
        raise Refused("it circles a goal: it cannot turn to a yaw there", hint="leave the yaw out")


class _Course:
    """Progress of a task: remaining metres of the whole path."""

    def __init__(self, start: GeoPoint, targets: tuple[NavigationTarget, ...]) -> None:
        points = [start, *(target.point for target in targets)]
        self._legs = [_distance(*pair) for pair in itertools.pairwise(points)]
        self._length = max(sum(self._legs), 0.01)
        self._percent = 0.0

    def progress(self, leg: int, left: float, message: str, *, blocked: bool = False) -> Progress:
        """Return 0 to 99 percent, never less than before; ``left``: remaining metres of this leg."""
        ahead = left + sum(self._legs[leg + 1 :])
        self._percent = max(self._percent, min(99.0, 100 * (1 - ahead / self._length)))
        remaining = ahead if math.isfinite(ahead) else None
        return Progress(self._percent, message, blocked, remaining=remaining)


class _ProgressWatch:
    """Detects that the distance no longer decreases."""

    def __init__(self, now: float) -> None:
        self._best = math.inf
        self._since = now

    def stuck_for(self, left: float, now: float) -> float:
        """Return the seconds since the distance last decreased."""
        if left < self._best - _NEARER:
            self._best = left
            self._since = now
        return now - self._since


class AutopilotNavigator:
    """Executes navigation tasks with one vehicle."""

    def __init__(self, flight: Flight, takeoff: TakeOff, limits: Limits) -> None:
        self._flight = flight
        self._takeoff = takeoff
        self._limits = limits
        self._vehicle = flight.vehicle

    async def carry_out(self, task: RouteTask, origin: GeoOrigin) -> AsyncIterator[Progress]:
        """Fly a task; everything is checked before anything is sent. Raises if it cannot be done."""
        require_has(self._vehicle, "goto")
        require_movable(self._vehicle, self._flight.authority)
        self._require_no_takeoff()
        here = known_position(self._vehicle)
        if self._flight.flavour.surface:
            _require_along(task)
        if self._flight.flavour.wings:
            _require_circled(task)
        targets = targets_of(task, self._vehicle.state, origin)
        async for progress in self._fly_all(targets, here, task.constraints):
            yield progress

    async def go_home(self) -> AsyncIterator[Progress]:
        """Return home by the autopilot's own mode, and stand or circle there, without a landing."""
        flight, vehicle = self._flight, self._vehicle
        require_connection(vehicle)
        home, flavour = vehicle.state.home, flight.flavour
        if not await flight.arming.has_motors_on():
            raise not_armed()
        if home is None:
            raise home_unknown()
        target = NavigationTarget(home, None, 0.0, level=True)
        course = _Course(known_position(vehicle), (target,))
        flight.end_stream(flavour, flavour.return_home)
        await flight.enter(flavour.return_home, effect=effect_of_descent(flavour))
        yield course.progress(0, self._left(target), "on the way home")
        async for blocked in self._until(target, flavour.tolerance, flavour.return_home, turned=False):
            yield course.progress(0, self._left(target), "on the way home", blocked=blocked)
        yield Progress(100.0, "at home")

    async def fly_to(self, point: GeoPoint) -> AsyncIterator[Progress]:
        """Fly to one position (altitude AMSL), keeping the heading; raises like ``carry_out``."""
        require_has(self._vehicle, "goto")
        require_movable(self._vehicle, self._flight.authority)
        here = known_position(self._vehicle)
        async for progress in self._fly_all((NavigationTarget(point, None, 0.0),), here, Constraints()):
            yield progress

    async def _fly_all(
        self, targets: tuple[NavigationTarget, ...], here: GeoPoint, constraints: Constraints
    ) -> AsyncIterator[Progress]:
        """Check every target, then fly to each in turn; hold after a failure."""
        for target in targets:
            self._require_reachable(target)
        for one, other in itertools.pairwise((here, *(target.point for target in targets))):
            self._speed(constraints, one, other)  # raises for a speed that it cannot fly at
        course = _Course(here, targets)
        nose = known_heading(self._vehicle)
        try:
            for leg, target in enumerate(targets):
                nose = nose if target.heading is None else target.heading
                async for progress in self._fly(target, nose, leg, course, constraints):
                    yield msgspec.structs.replace(progress, reached=leg)
        except CommandError:
            await self._flight.hold_if_ours()
            raise
        yield Progress(100.0, "there", reached=len(targets))

    def _require_no_takeoff(self) -> None:
        """Raise NotReady during a take-off: a goal would end the take-off near the ground."""
        flavour = self._flight.flavour
        shown = flavour.takeoff != flavour.arming and flavour.mode_of(self._vehicle.state) == flavour.takeoff
        if self._takeoff.under_way or shown:
            raise NotReady("busy: it takes off", hint="wait for its end, or send hover")

    def _require_reachable(self, target: NavigationTarget) -> None:
        """Raise Refused for a target beyond the limits."""
        self._flight.require_altitude(target.point.altitude)
        self._flight.require_distance(target.point, self._reach)

    def _speed(self, constraints: Constraints, one: GeoPoint, other: GeoPoint) -> float:
        """Return the speed between two positions: the requested one, within the limit; may raise Refused."""
        flight, away = self._flight, _offset(one, other).horizontal()
        state, limit = self._vehicle.state, self._limits.speed
        return flight.flavour.speed_to(state, limit, constraints.max_speed, away)

    async def _fly(
        self, target: NavigationTarget, nose: float, leg: int, course: _Course, constraints: Constraints
    ) -> AsyncIterator[Progress]:
        """Fly to one target with the nose at ``nose``, radians from north, and wait there."""
        flight = self._flight
        goto = flight.flavour.goto
        own = flight.flavour.tolerance
        tolerance = own if flight.flavour.wings else constraints.tolerance or own
        speed = self._speed(constraints, known_position(self._vehicle), target.point)
        await flight.go(target.point, speed, nose, backwards=target.backwards)
        yield course.progress(leg, self._left(target), "on the way")
        async for blocked in self._until(target, tolerance, goto, turned=False):
            yield course.progress(leg, self._left(target), "on the way", blocked=blocked)
        if target.heading is not None:
            async for blocked in self._until(target, math.inf, goto, turned=True):
                yield course.progress(leg, 0.0, "turning", blocked=blocked)
        yield course.progress(leg, 0.0, "there")
        await flight.wait(target.wait, goto)

    async def _until(
        self, target: NavigationTarget, tolerance: float, mode: str, *, turned: bool
    ) -> AsyncIterator[bool]:
        """Wait, in a mode, until it stands at a target or has turned to it; yields whether it is stuck."""

        def there(state: VehicleState) -> bool:
            if turned:
                return _turn_left(target, state) <= _YAW_TOLERANCE
            stands = self._flight.flavour.wings or is_standing(state)
            return self._left(target) <= tolerance and stands

        watch = _ProgressWatch(self._vehicle.now())
        while not await self._vehicle.until(there, _POLL):
            self._flight.check(mode)
            left = _turn_left(target, self._vehicle.state) if turned else self._left(target)
            stuck = watch.stuck_for(left, self._vehicle.now())
            if stuck > _GIVE_UP_AFTER:
                raise TimedOut(f"it has not got nearer for {_GIVE_UP_AFTER:g} s, {left:.1f} m are left")
            yield stuck > _STUCK_AFTER

    def _left(self, target: NavigationTarget) -> float:
        """Return metres to a target, or to the circle around it; infinite while the position is unknown."""
        state = self._vehicle.state
        if state.position is None:
            return math.inf
        offset = _offset(state.position, target.point)
        flat = max(0.0, offset.horizontal() - self._reach)
        return flat if state.on_the_surface or target.level else math.hypot(flat, offset.z)

    @property
    def _reach(self) -> float:
        """Distance at which it counts as arrived, because it circles a position; m."""
        flavour = self._flight.flavour
        return flavour.reach(self._vehicle.state) if isinstance(flavour, Winged) else 0.0


def _turn_left(target: NavigationTarget, state: VehicleState) -> float:
    """Return the remaining turn to the target's heading, rad; infinite while the attitude is unknown."""
    if state.attitude is None or target.heading is None:
        return math.inf
    return abs(wrap_angle(target.heading - state.attitude.yaw))
