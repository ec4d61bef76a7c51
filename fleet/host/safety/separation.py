"""Separation of the robots of one edge: checks paths before they start, and motion while it happens. Pure.

Everything is in the site's frame, metres. A robot is a ball around its position: two are too near when their
centres are closer than the sum of their radii. Before a robot is sent anywhere, its whole straight path is
compared with the positions and whole paths of the others, independent of time. While it moves, stopping paths
are compared: where a robot goes until it stands. Motion that brings no two robots nearer is always admitted.

A robot that has not reported for a while is not forgotten: its ball grows by the distance that it may have
covered since.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import msgspec

from fleet.model.geometry import Vector3, rotate_to_world
from fleet.model.polyline import apart, beginning

REACTION = 0.8  # s until a robot brakes: age of its pose, control period, transmission and its own reaction
SOONER = 0.5  # s by which the robot that gives way brakes earlier than the one with precedence
ADMITTED = 0.2  # m beyond the radii that a planned path must keep: robots deviate from it
HELD = 0.1  # m beyond the radii at which a robot in motion must stand
FRESH = 1.0  # s for which a reported position is taken as exact
LONGEST = 10.0  # s of continued motion that are assumed at most for a silent robot
ASTRAY = 0.3  # m/s across its path, beyond position noise and a turn towards the path
STILL = 0.1  # m/s and below: the robot stands, the rest is position noise
DEFAULT_BRAKING = 0.5  # m/s2 of a robot for which neither its configuration nor its adapter declares it
SLACK = 0.01  # m of tolerance in comparing distances
ARC = 3  # straight pieces that approximate an arc
_STEPS = 6  # bisection steps in the search for the admitted share of a velocity


class Occupant(msgspec.Struct, frozen=True):
    """Space and motion of one robot.

    ``route`` is its path from ``at`` on, of the host or its autopilot; empty when it stands or is driven.
    ``velocity`` (m/s) is measured, ``requested`` is requested and turns with ``turn`` (rad/s).
    ``braking`` is the deceleration (m/s2) that it surely reaches.
    ``age`` is seconds since its last position. ``moves``: its edge moves it. Of two that are in each
    other's way, the one with the lower ``precedence`` gives way; of equals, the later name.
    """

    name: str
    radius: float
    braking: float
    at: Vector3
    route: tuple[Vector3, ...] = msgspec.field(name="way", default=())
    velocity: Vector3 = Vector3()
    requested: Vector3 = Vector3()
    turn: float = 0.0
    age: float = 0.0
    moves: bool = False
    precedence: tuple[float, ...] = ()

    @property
    def speed(self) -> float:
        """Larger of measured and requested speed, m/s."""
        return max(self.velocity.norm(), self.requested.norm())

    @property
    def uncertainty(self) -> float:
        """Uncertainty of its position since the last report, m."""
        return distance_since(self.speed, self.age)

    @property
    def occupied_path(self) -> tuple[Vector3, ...]:
        """Polyline that it occupies: its position and its path."""
        return (self.at, *self.route)

    def gives_way_to(self, other: Occupant) -> bool:
        """Return whether this robot must brake first."""
        return (self.precedence, other.name) < (other.precedence, self.name)

    def stopping_path(self, late: float = 0.0) -> tuple[Vector3, ...]:
        """Return the polyline that it covers until it stands, if it brakes in ``late`` seconds.

        If requested and measured motion differ, the polyline encloses everything between the two.
        """
        speed = self.speed
        if self.route and speed > STILL:
            line = beginning(self.occupied_path, stopping(speed, self.braking) + speed * late)
            aside = self.aside(self.route[0])
            return (self.at, *(point + aside for point in line), *reversed(line)) if aside.norm() else line
        moves = self.velocity.norm() > STILL
        drift = self._course(self.velocity, 0.0, late) if moves else (self.at,)
        requested = self.course(self.requested, late)
        return (*reversed(drift), *requested[1:], drift[-1]) if len(requested) > 1 else drift

    def aside(self, goal: Vector3) -> Vector3:
        """Return how far (m) its momentum carries it off the straight path to a goal."""
        offset = goal - self.at
        along = offset.scaled(1 / offset.norm()) if offset.norm() > SLACK else Vector3()
        ahead = self.velocity.x * along.x + self.velocity.y * along.y + self.velocity.z * along.z
        off = self.velocity - along.scaled(max(0.0, ahead))
        speed = off.norm()
        return off.scaled(stopping(speed, self.braking) / speed) if speed > ASTRAY else Vector3()

    def course(self, velocity: Vector3, late: float = 0.0) -> tuple[Vector3, ...]:
        """Return the polyline that it would cover at a velocity, including its turn, until it stands.

        It brakes straight ahead, at any moment. In a turn the polyline therefore also goes to the point where
        the robot would stand if it braked now, and ends there.
        """
        line = self._course(velocity, self.turn, late)
        if not self.turn or len(line) == 1:
            return line
        ahead = self._course(velocity, 0.0, late)[-1]
        return (*line, ahead, self.at, ahead)

    def _course(self, velocity: Vector3, turn: float, late: float) -> tuple[Vector3, ...]:
        """Return the arc up to the start of braking, and the straight braking distance."""
        speed = velocity.norm()
        if speed == 0.0:
            return (self.at,)
        line, piece = [self.at], (REACTION + late) / ARC
        for number in range(ARC if turn else 1):
            step = rotate_to_world(velocity, turn * piece * (number + 0.5)) if turn else velocity.scaled(ARC)
            line.append(line[-1] + step.scaled(piece))
        last = rotate_to_world(velocity, turn * piece * ARC)
        return (*line, line[-1] + last.scaled(speed / (2 * self.braking)))


def distance_since(speed: float, age: float) -> float:
    """Return the metres that a robot may have covered since it reported its speed ``age`` seconds ago."""
    return 0.0 if age <= FRESH or speed <= STILL else speed * min(age, LONGEST)


def stopping(speed: float, braking: float) -> float:
    """Return the stopping distance (m) at this speed (m/s), with the reaction time."""
    return speed * REACTION + speed * speed / (2 * braking)


def speed_within(metres: float, braking: float) -> float:
    """Return the highest speed (m/s) from which a robot stops within these metres."""
    late = braking * REACTION
    return math.sqrt(late * late + 2 * braking * max(0.0, metres)) - late


def needed(one: Occupant, other: Occupant) -> float:
    """Return the required distance between the centres of two robots, m."""
    return one.radius + other.radius + one.uncertainty + other.uncertainty


def route_trouble(robot: Occupant, points: Iterable[Vector3], others: Iterable[Occupant]) -> str:
    """Return why a robot may not go through these points; empty when it may."""
    steps = list(enumerate(points, 1))
    routes = [steps]
    if steps and (aside := robot.aside(steps[0][1])).norm():
        routes.append([(0, robot.at + aside), steps[0]])
    for other in others:
        least = needed(robot, other) + ADMITTED
        for route in routes:
            line = (robot.at, *(point for _, point in route))
            near = apart(line, other.occupied_path, least) < least
            if near and (trouble := _step_trouble(robot.at, route, other, least)):
                return trouble
    return ""


def _step_trouble(start: Vector3, steps: Sequence[tuple[int, Vector3]], other: Occupant, least: float) -> str:
    """Return which goal, or path to it, is too near another robot; one that is too near already may leave.

    ``steps`` are the points with their numbers; 0 is not a goal but the end of the robot's momentum.
    """
    before = apart((start,), other.occupied_path)
    for number, point in steps:
        nearest, after = apart((start, point), other.occupied_path), apart((point,), other.occupied_path)
        if nearest < min(least, before) - SLACK:
            at_goal = number and after <= nearest + SLACK
            what = f"goal {number}" if at_goal else f"the straight way to goal {max(number, 1)}"
            whose = other.name
            if nearest < apart((start, point), (other.at,)) - SLACK:
                whose = f"{other.name}'s way"
            return f"{what} is {nearest:.1f} m from {whose}, {least:.1f} m are kept{_silence(other)}"
        start, before = point, after
    return ""


def _silence(other: Occupant) -> str:
    """Return how long a robot has been silent, as text; empty when it is not."""
    return f" ({other.name} has not reported its position for {other.age:.0f} s)" if other.age > FRESH else ""


def must_brake(robot: Occupant, other: Occupant) -> bool:
    """Return whether a robot in motion must be stopped now because of another.

    It must when their stopping paths come too near each other and its own motion contributes to that.
    """
    least = needed(robot, other) + HELD
    mine, theirs = robot.stopping_path(_sooner(robot, other)), other.stopping_path()
    if apart(mine, theirs, least) >= least:
        return False
    here = apart((robot.at,), theirs)
    return apart(mine, theirs) < min(least, here) - SLACK


def _sooner(robot: Occupant, other: Occupant) -> float:
    """Return by how many seconds a robot brakes early because it gives way."""
    return SOONER if other.moves and robot.gives_way_to(other) else 0.0


def gap(robot: Occupant, other: Occupant, ahead: float) -> float:
    """Return the metres that a robot may go in any direction in the next ``ahead`` seconds."""
    theirs = stopping(other.speed, other.braking) + other.speed * (ahead + SOONER)
    return (robot.at - other.at).norm() - needed(robot, other) - HELD - theirs


def free_speed(gap: float, braking: float, ahead: float) -> float:
    """Return the highest speed (m/s) that ``ahead`` seconds from now still stops within ``gap`` metres.

    A cheap bound that admits most velocities without the exact check.
    """
    return max(0.0, speed_within(gap, braking) - braking * ahead)


def admitted(robot: Occupant, velocity: Vector3, other: Occupant) -> float:
    """Return the share (0 to 1) of a velocity (m/s) that a robot may hold in the presence of another.

    The direction stays; the speed shrinks to one at which it can stop. Motion that brings it no nearer passes
    unchanged. Its momentum in another direction does not vanish at once, so everything between measured and
    requested motion must be clear.
    """
    least = needed(robot, other) + HELD
    theirs = other.stopping_path(_sooner(robot, other))
    # Within the other's early-braking path no position counts as nearer: then its sure path decides.
    paths = (theirs, other.stopping_path())
    here = [apart((robot.at,), path) for path in paths]
    drift = msgspec.structs.replace(robot, requested=Vector3()).stopping_path()

    def passes(part: float) -> bool:
        course = robot.course(velocity.scaled(part))
        around = (*reversed(drift), *course[1:], drift[-1])
        if apart(around, theirs, least) >= least:
            return True
        return all(apart(course, path) >= now - 1e-6 for path, now in zip(paths, here, strict=True))

    if passes(1.0):
        return 1.0
    share, more = 0.0, 1.0
    for _ in range(_STEPS):
        middle = (share + more) / 2
        share, more = (middle, more) if passes(middle) else (share, middle)
    return share if share * velocity.norm() > STILL else 0.0
