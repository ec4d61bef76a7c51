"""Circling radius around the places of a task: a fixed wing cannot hover at a point. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from fleet.model.navigation import AnyTask, FlyMission, FollowPath


def circling_radii(task: AnyTask, radius: float) -> Iterable[float]:
    """Yield the circling radius at each place of a task, m; ``radius`` is the robot's own, 0 if it can stand.

    A mission flies through all waypoints but the last item, and stands where it lands.
    """
    if not radius:
        return
    if not isinstance(task, FlyMission):
        places = len(task.goals) + 1 if isinstance(task, FollowPath) else 1  # loops return to the first
        yield from [radius] * places
        return
    for number, item in enumerate(task.items, 1):
        if item.point is not None:
            passes = item.kind == "land" or (item.kind == "waypoint" and number < len(task.items))
            yield 0.0 if passes else max(radius, item.radius or 0.0)
