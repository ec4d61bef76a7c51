"""Conversion of a task to legs in the plane. Pure. Metres in the robot's world frame, radians."""

from __future__ import annotations

import math

import msgspec

from fleet.errors import Refused
from fleet.model.geodesy import GeoOrigin, world_from_geo
from fleet.model.geometry import Pose, Vector3, rotate_to_world
from fleet.model.navigation import FlyMission, FollowPath, Goal, GoTo, RelativeMove, Task

FlatPoint = tuple[float, float]
FARTHEST = 10_000.0  # m; a goal beyond is certainly a mistake
MOST_GOALS = 1000


class Leg(msgspec.Struct, frozen=True):
    """A path that ends in a standstill: through ``points`` to the last, then ``yaw`` and ``wait`` seconds.

    ``backwards``: the robot drives in reverse.
    """

    points: tuple[FlatPoint, ...]
    yaw: float | None = None
    wait: float = 0.0
    backwards: bool = False


def legs_of(task: Task, pose: Pose, origin: GeoOrigin | None) -> tuple[Leg, ...]:
    """Return the legs of a task from the robot's pose; raises Refused for an undrivable task."""
    match task:
        case GoTo():
            goals: tuple[Goal, ...] = (task.goal,)
        case FollowPath():
            goals = task.goals * task.loops
        case RelativeMove():
            return (_relative(task, pose),)
        case FlyMission():
            raise Refused("this robot has no memory for missions", hint="send the goals as a path")
    if not 1 <= len(goals) <= MOST_GOALS:
        raise Refused(f"a path has 1 to {MOST_GOALS} goals, loops counted")
    return _legs(goals, pose.position, origin)


def _legs(goals: tuple[Goal, ...], start: Vector3, origin: GeoOrigin | None) -> tuple[Leg, ...]:
    """Split a path where the robot has to stand: at a heading, at a wait, at the end."""
    legs: list[Leg] = []
    points: list[FlatPoint] = []
    for number, goal in enumerate(goals, 1):
        points.append(_place(goal, start, origin))
        if goal.yaw is not None or goal.wait > 0 or number == len(goals):
            legs.append(Leg(tuple(points), goal.yaw, goal.wait))
            points = []
    return tuple(legs)


def _relative(task: RelativeMove, pose: Pose) -> Leg:
    """Return the leg of a relative move; a mostly backward move is driven in reverse."""
    move, yaw = task.translation, pose.rotation.yaw
    body = move if task.body_frame else rotate_to_world(move, -yaw)
    world = rotate_to_world(move, yaw) if task.body_frame else move
    place = pose.position + world
    return Leg((_checked(place, pose.position),), backwards=body.x < 0 and abs(body.y) < abs(body.x))


def _place(goal: Goal, start: Vector3, origin: GeoOrigin | None) -> FlatPoint:
    """Return a goal in the world frame."""
    if goal.position is not None:
        return _checked(goal.position, start)
    if origin is None or goal.geo is None:
        raise Refused("a place on Earth needs the robot's origin", hint="origin: in fleet.yaml")
    return _checked(world_from_geo(origin, goal.geo), start)


def _checked(place: Vector3, start: Vector3) -> FlatPoint:
    """Return a point in the plane; raises Refused if it is not finite or too far."""
    if not (math.isfinite(place.x) and math.isfinite(place.y)):
        raise Refused("a goal has finite coordinates")
    if (place - start).horizontal() > FARTHEST:
        raise Refused(f"the goal is more than {FARTHEST / 1000:g} km away")
    return place.x, place.y
