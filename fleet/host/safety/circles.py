"""How wide a robot circles about the places of a task: what cannot stand never ends at a point. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from fleet.model.navigation import AnyTask, FlyMission, FollowPath


def circled(task: AnyTask, radius: float) -> Iterable[float]:
    """Yield how wide it circles about each place of a task, m; ``radius`` is its own, 0 for what stands.

    A mission passes those of its waypoints that are not its last item, and stands where it lands.
    """
    if not radius:
        return
    if not isinstance(task, FlyMission):
        places = len(task.goals) + 1 if isinstance(task, FollowPath) else 1  # loops lead back to the first
        yield from [radius] * places
        return
    for number, item in enumerate(task.items, 1):
        if item.point is not None:
            passes = item.kind == "land" or (item.kind == "waypoint" and number < len(task.items))
            yield 0.0 if passes else max(radius, item.radius or 0.0)
