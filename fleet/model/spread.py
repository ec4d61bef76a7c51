"""Places for several robots around one point, and who goes to which; pure, metres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fleet.model.geometry import Vector3, rotate_to_world
from fleet.model.polyline import apart

TURNS = 12  # directions of the grid that are tried
BETTER = 0.1  # m by which the ways must keep farther apart to turn it once more


def spread(number: int, spacing: float) -> tuple[Vector3, ...]:
    """Return where ``number`` robots stand on a square grid around nought, ``spacing`` from each other."""
    columns = math.ceil(math.sqrt(number))
    rows = math.ceil(number / columns)
    return tuple(
        Vector3((at % columns - (columns - 1) / 2) * spacing, ((rows - 1) / 2 - at // columns) * spacing)
        for at in range(number)
    )


def arranged(robots: Sequence[Vector3], centre: Vector3, spacing: float) -> list[Vector3]:
    """Return for each robot its place, beside ``centre``: the grid is turned so that the ways keep apart."""
    best: tuple[float, list[Vector3]] = (-math.inf, [])
    grid = spread(len(robots), spacing)
    for turn in range(TURNS):
        steps = [rotate_to_world(step, turn * math.pi / TURNS) for step in grid]
        order = nearest_each(robots, [centre + step for step in steps])
        chosen = [steps[number] for number in order]
        ways = [(robot, centre + step) for robot, step in zip(robots, chosen, strict=True)]
        least = min((apart(one, other) for one, other in itertools.combinations(ways, 2)), default=0.0)
        if least > best[0] + BETTER:
            best = least, chosen
    return best[1]


def nearest_each(robots: Sequence[Vector3], places: Sequence[Vector3]) -> list[int]:
    """Return for each robot the number of its place, so that no two straight ways cross.

    Two that would gain by it change places until none do; ways that cross are longer than the same ways
    changed over.
    """
    chosen = list(range(len(robots)))
    changed = True
    while changed:
        changed = False
        for one, other in itertools.combinations(range(len(chosen)), 2):
            now = _far(robots[one], places[chosen[one]]) + _far(robots[other], places[chosen[other]])
            then = _far(robots[one], places[chosen[other]]) + _far(robots[other], places[chosen[one]])
            if then < now - 1e-9:
                chosen[one], chosen[other] = chosen[other], chosen[one]
                changed = True
    return chosen


def _far(one: Vector3, other: Vector3) -> float:
    """Return metres over ground between two points."""
    return (one - other).horizontal()
