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

from fleet.model.geometry import Vector3
from fleet.model.polyline import apart, beginning

REACTION = 0.6  # s until a robot brakes: the age of its pose, the look at it, the way to it, its answer
SOONER = 0.5  # s by which the one that gives way brakes before the one that has it
ADMITTED = 0.2  # m beyond the radii that a way must keep: no robot keeps to its way by the centimetre
HELD = 0.1  # m beyond the radii at which a robot in motion must stand
FRESH = 1.0  # s for which a place is taken as it was told
LONGEST = 10.0  # s for which a robot that is not heard may have gone on
STILL = 0.1  # m/s and below: it stands, and its place is noisy
SLACK = 0.01  # m that is no change of a distance
CREEP = 0.03  # m/s below which a slowed robot is held
_STEPS = 12  # halvings, in the search for how far a robot may go


class Occupant(msgspec.Struct, frozen=True):
    """What one robot takes up.

    ``way``: where it is sent from ``at`` on, by the host or by its autopilot; empty for one that stands or
    is driven. ``velocity`` (m/s) is measured, or what is held. ``braking``: m/s2 that it surely brakes with.
    ``age``: seconds since it told its place. ``moves``: something of ours moves it. Of two that are in each
    other's way the one with the lower ``precedence`` gives way; of equals, the later name.
    """

    name: str
    radius: float
    braking: float
    at: Vector3
    way: tuple[Vector3, ...] = ()
    velocity: Vector3 = Vector3()
    age: float = 0.0
    moves: bool = False
    precedence: tuple[float, ...] = ()

    @property
    def speed(self) -> float:
        """How fast it is, m/s."""
        return self.velocity.norm()

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
        """Return the line that it goes until it stands, when it is told to in ``late`` seconds."""
        speed = self.speed
        if speed <= STILL:
            return (self.at,)
        metres = stopping(speed, self.braking) + speed * late
        if self.way:
            return beginning(self.claim, metres)
        return (self.at, self.at + self.velocity.scaled(metres / speed))


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
    way = (robot.at, *points)
    for other in others:
        least = needed(robot, other) + ADMITTED
        theirs = other.claim
        if apart(way, theirs, least) >= least:
            continue
        trouble = _step_trouble(way, other, least)
        if trouble:
            return trouble
    return ""


def _step_trouble(way: Sequence[Vector3], other: Occupant, least: float) -> str:
    """Return which goal is too near another robot, or the way to it; one that is too near may leave."""
    before = apart(way[:1], other.claim)
    for number in range(1, len(way)):
        nearest = apart(way[number - 1 : number + 1], other.claim)
        after = apart(way[number : number + 1], other.claim)
        if nearest < min(least, before) - SLACK:
            what = f"goal {number}" if after <= nearest + SLACK else f"the straight way to goal {number}"
            whose = f"{other.name}'s way" if nearest < apart(way, (other.at,)) - SLACK else other.name
            return f"{what} is {nearest:.1f} m from {whose}, {least:.1f} m are kept{_silence(other)}"
        before = after
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


def free_speed(robot: Occupant, others: Iterable[Occupant], ahead: float) -> float:
    """Return the speed (m/s) at which a robot may go in any direction for ``ahead`` seconds; infinite alone.

    It is what makes most velocities pass without a closer look.
    """
    gaps = (
        (robot.at - other.at).norm()
        - (needed(robot, other) + HELD)
        - (stopping(other.speed, other.braking) + other.speed * (ahead + SOONER))
        for other in others
    )
    least = min(gaps, default=math.inf)
    return (
        math.inf
        if least == math.inf
        else max(0.0, speed_within(least, robot.braking) - robot.braking * ahead)
    )


def admitted(robot: Occupant, velocity: Vector3, other: Occupant) -> float:
    """Return the share (0 to 1) of a velocity (m/s) that a robot may hold in the presence of another.

    The direction stays: it goes where it was asked to, but no faster than it can stop.
    """
    speed = velocity.norm()
    least = needed(robot, other) + HELD
    wanted = stopping(speed, robot.braking)
    if speed == 0.0:
        return 1.0
    theirs = other.stopping_way(_sooner(robot, other))
    along = velocity.scaled(1.0 / speed)
    if _passes(robot.at, along, wanted, theirs, least):
        return 1.0
    near, far = 0.0, wanted
    for _ in range(_STEPS):
        middle = (near + far) / 2
        near, far = (middle, far) if _passes(robot.at, along, middle, theirs, least) else (near, middle)
    slower = speed_within(near, robot.braking)
    return slower / speed if slower > CREEP else 0.0


def _passes(at: Vector3, along: Vector3, metres: float, theirs: Sequence[Vector3], least: float) -> bool:
    """Return whether a robot may go so far along a direction: not too near, or no nearer than it is."""
    way = (at, at + along.scaled(metres))
    if apart(way, theirs, least) >= least:
        return True
    here = apart((at,), theirs)
    return here < least and apart(way, theirs) >= here - 1e-6
