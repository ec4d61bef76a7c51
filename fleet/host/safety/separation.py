"""The rules that keep the robots of one edge apart: ways before they begin, motion as it happens. Pure.

Everything is in the site's frame, metres. A robot is a ball around its place: two are too near when their
centres are less than their radii from each other. Before a robot is sent anywhere, the whole of its straight
way is compared with where the others are and with the whole of theirs, without time. While it moves, what is
compared is the stopping way: how far it goes until it stands. What brings nobody nearer always passes.

A place that was not told for a while is not forgotten: it grows by how far the robot may have gone since.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import msgspec

from fleet.model.geometry import Vector3, rotate_to_world
from fleet.model.polyline import apart, beginning

REACTION = 0.8  # s until a robot brakes: the age of its pose, the look at it, the way to it, its answer
SOONER = 0.5  # s by which the one that gives way brakes before the one that has it
ADMITTED = 0.2  # m beyond the radii that a way must keep: no robot keeps to its way by the centimetre
HELD = 0.1  # m beyond the radii at which a robot in motion must stand
FRESH = 1.0  # s for which a place is taken as it was told
LONGEST = 10.0  # s for which a robot that is not heard may have gone on
ASTRAY = 0.3  # m/s off its way that are more than a noisy place and a turn towards it
STILL = 0.1  # m/s and below: it stands, and its place is noisy
SLACK = 0.01  # m that is no change of a distance
ARC = 3  # straight pieces for an arc
_STEPS = 6  # halvings, in the search for how far a robot may go


class Occupant(msgspec.Struct, frozen=True):
    """What one robot takes up.

    ``way``: where it is sent from ``at`` on, by the host or by its autopilot; empty for one that stands or
    is driven. ``velocity`` (m/s) is measured, ``asked`` what it is to have, turning with ``turn`` (rad/s).
    ``braking``: m/s2 that it surely brakes with.
    ``age``: seconds since it told its place. ``moves``: something of ours moves it. Of two that are in each
    other's way the one with the lower ``precedence`` gives way; of equals, the later name.
    """

    name: str
    radius: float
    braking: float
    at: Vector3
    way: tuple[Vector3, ...] = ()
    velocity: Vector3 = Vector3()
    asked: Vector3 = Vector3()
    turn: float = 0.0
    age: float = 0.0
    moves: bool = False
    precedence: tuple[float, ...] = ()

    @property
    def speed(self) -> float:
        """How fast it is or is to be, m/s."""
        return max(self.velocity.norm(), self.asked.norm())

    @property
    def doubt(self) -> float:
        """Metres that it may be from where it was heard last."""
        return gone_since(self.speed, self.age)

    @property
    def claim(self) -> tuple[Vector3, ...]:
        """The line that is its own: its place, and the way that it is sent."""
        return (self.at, *self.way)

    def gives_way_to(self, other: Occupant) -> bool:
        """Return whether it is the one to brake first."""
        return (self.precedence, other.name) < (other.precedence, self.name)

    def stopping_way(self, late: float = 0.0) -> tuple[Vector3, ...]:
        """Return the line that it goes until it stands, when it is told to in ``late`` seconds.

        Where it is to go otherwise than it goes, that is the line around all ways between the two.
        """
        speed = self.speed
        if self.way and speed > STILL:
            line = beginning(self.claim, stopping(speed, self.braking) + speed * late)
            aside = self.aside(self.way[0])
            return (self.at, *(point + aside for point in line), *reversed(line)) if aside.norm() else line
        moves = self.velocity.norm() > STILL
        drift = self._course(self.velocity, 0.0, late) if moves else (self.at,)
        asked = self.course(self.asked, late)
        return (*reversed(drift), *asked[1:], drift[-1]) if len(asked) > 1 else drift

    def aside(self, goal: Vector3) -> Vector3:
        """Return how far (m) its speed bears it off the straight way to a goal, before it is on it."""
        way = goal - self.at
        along = way.scaled(1 / way.norm()) if way.norm() > SLACK else Vector3()
        ahead = self.velocity.x * along.x + self.velocity.y * along.y + self.velocity.z * along.z
        off = self.velocity - along.scaled(max(0.0, ahead))
        speed = off.norm()
        return off.scaled(stopping(speed, self.braking) / speed) if speed > ASTRAY else Vector3()

    def course(self, velocity: Vector3, late: float = 0.0) -> tuple[Vector3, ...]:
        """Return the line that it would go at a velocity, turning as it does, until it stands.

        It brakes straight ahead, whenever it is told to: where it turns, the line also goes to where it
        would stand if it were told to at once, and ends there.
        """
        line = self._course(velocity, self.turn, late)
        if not self.turn or len(line) == 1:
            return line
        ahead = self._course(velocity, 0.0, late)[-1]
        return (*line, ahead, self.at, ahead)

    def _course(self, velocity: Vector3, turn: float, late: float) -> tuple[Vector3, ...]:
        """Return an arc for as long as it takes until it brakes, and the straight way on which it does."""
        speed = velocity.norm()
        if speed == 0.0:
            return (self.at,)
        line, piece = [self.at], (REACTION + late) / ARC
        for number in range(ARC if turn else 1):
            way = rotate_to_world(velocity, turn * piece * (number + 0.5)) if turn else velocity.scaled(ARC)
            line.append(line[-1] + way.scaled(piece))
        last = rotate_to_world(velocity, turn * piece * ARC)
        return (*line, line[-1] + last.scaled(speed / (2 * self.braking)))


def gone_since(speed: float, age: float) -> float:
    """Return how many metres a robot may have gone that told its place and speed ``age`` seconds ago."""
    return 0.0 if age <= FRESH or speed <= STILL else speed * min(age, LONGEST)


def stopping(speed: float, braking: float) -> float:
    """Return the metres until a robot of this speed (m/s) stands, from when it should."""
    return speed * REACTION + speed * speed / (2 * braking)


def speed_within(metres: float, braking: float) -> float:
    """Return the speed (m/s) from which a robot stands within these metres."""
    late = braking * REACTION
    return math.sqrt(late * late + 2 * braking * max(0.0, metres)) - late


def needed(one: Occupant, other: Occupant) -> float:
    """Return the metres between their centres that two robots must keep."""
    return one.radius + other.radius + one.doubt + other.doubt


def way_trouble(robot: Occupant, points: Iterable[Vector3], others: Iterable[Occupant]) -> str:
    """Return why a robot may not go through these points, empty when it may."""
    steps = list(enumerate(points, 1))
    ways = [steps]
    if steps and (aside := robot.aside(steps[0][1])).norm():
        ways.append([(0, robot.at + aside), steps[0]])
    for other in others:
        least = needed(robot, other) + ADMITTED
        for way in ways:
            line = (robot.at, *(point for _, point in way))
            near = apart(line, other.claim, least) < least
            if near and (trouble := _step_trouble(robot.at, way, other, least)):
                return trouble
    return ""


def _step_trouble(start: Vector3, steps: Sequence[tuple[int, Vector3]], other: Occupant, least: float) -> str:
    """Return which goal is too near another robot, or the way to it; one that is too near may leave.

    ``steps`` are the points with their numbers; 0 is no goal, but where its speed bears it.
    """
    before = apart((start,), other.claim)
    for number, point in steps:
        nearest, after = apart((start, point), other.claim), apart((point,), other.claim)
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
    """Say how long a robot has not told its place, when that is long."""
    return f" ({other.name} has not said where it is for {other.age:.0f} s)" if other.age > FRESH else ""


def must_brake(robot: Occupant, other: Occupant) -> bool:
    """Return whether a robot in motion must be brought to a standstill now for another.

    It must when the stopping ways of the two come too near each other and its own motion is part of that.
    """
    least = needed(robot, other) + HELD
    mine, theirs = robot.stopping_way(_sooner(robot, other)), other.stopping_way()
    if apart(mine, theirs, least) >= least:
        return False
    here = apart((robot.at,), theirs)
    return apart(mine, theirs) < min(least, here) - SLACK


def _sooner(robot: Occupant, other: Occupant) -> float:
    """Return the seconds by which a robot brakes before it would have to, because it gives way."""
    return SOONER if other.moves and robot.gives_way_to(other) else 0.0


def gap(robot: Occupant, other: Occupant, ahead: float) -> float:
    """Return the metres that a robot may go in any direction in the next ``ahead`` seconds."""
    theirs = stopping(other.speed, other.braking) + other.speed * (ahead + SOONER)
    return (robot.at - other.at).norm() - needed(robot, other) - HELD - theirs


def free_speed(gap: float, braking: float, ahead: float) -> float:
    """Return the speed (m/s) at which a robot goes at most that far, until it stands, and is looked at again.

    It is what makes most velocities pass without a closer look.
    """
    return max(0.0, speed_within(gap, braking) - braking * ahead)


def admitted(robot: Occupant, velocity: Vector3, other: Occupant) -> float:
    """Return the share (0 to 1) of a velocity (m/s) that a robot may hold in the presence of another.

    The direction stays: it goes where it was asked to, but no faster than it can stop. What comes no nearer
    than it is passes whole. What it has of speed in another direction is not gone at once: all between the
    two must be clear.
    """
    least = needed(robot, other) + HELD
    theirs = other.stopping_way(_sooner(robot, other))
    # One whose way may reach the robot itself is no farther anywhere: then the way that is sure counts.
    ways = (theirs, other.stopping_way())
    here = [apart((robot.at,), way) for way in ways]
    drift = msgspec.structs.replace(robot, asked=Vector3()).stopping_way()

    def passes(part: float) -> bool:
        course = robot.course(velocity.scaled(part))
        around = (*reversed(drift), *course[1:], drift[-1])
        if apart(around, theirs, least) >= least:
            return True
        return all(apart(course, way) >= now - 1e-6 for way, now in zip(ways, here, strict=True))

    if passes(1.0):
        return 1.0
    share, more = 0.0, 1.0
    for _ in range(_STEPS):
        middle = (share + more) / 2
        share, more = (middle, more) if passes(middle) else (share, middle)
    return share if share * velocity.norm() > STILL else 0.0
