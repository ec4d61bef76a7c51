"""Positions for several robots around one goal, and which robot goes to which; pure, metres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fleet.model.geometry import Vector3, rotate_to_world
from fleet.model.polyline import apart

ORIENTATIONS = 12  # orientations of the grid that are tried
MINIMUM_GAIN = 0.1  # m of extra separation that another orientation must gain to be preferred


def grid_positions(number: int, spacing: float) -> tuple[Vector3, ...]:
    """Return positions of ``number`` robots on a square grid around the origin, ``spacing`` metres apart."""
    columns = math.ceil(math.sqrt(number))
    rows = math.ceil(number / columns)
    return tuple(
        Vector3((at % columns - (columns - 1) / 2) * spacing, ((rows - 1) / 2 - at // columns) * spacing)
        for at in range(number)
    )


def arranged(robots: Sequence[Vector3], centre: Vector3, spacing: float) -> list[Vector3]:
    """Return for each robot its position relative to ``centre``.

    The grid is rotated so that the straight paths to it keep as far apart as possible.
    """
    best: tuple[float, list[Vector3]] = (-math.inf, [])
    grid = grid_positions(len(robots), spacing)
    for turn in range(ORIENTATIONS):
        steps = [rotate_to_world(step, turn * math.pi / ORIENTATIONS) for step in grid]
        order = nearest_each(robots, [centre + step for step in steps])
        chosen = [steps[number] for number in order]
        paths = [(robot, centre + step) for robot, step in zip(robots, chosen, strict=True)]
        least = min((apart(one, other) for one, other in itertools.combinations(paths, 2)), default=0.0)
        if least > best[0] + MINIMUM_GAIN:
            best = least, chosen
    return best[1]


def nearest_each(robots: Sequence[Vector3], places: Sequence[Vector3]) -> list[int]:
    """Return for each robot the index of its position, chosen so that no two straight paths cross.

    Two robots swap positions while that shortens their total path. Crossing paths are always longer than the
    same paths swapped (triangle inequality), so none are left in the end.
    """
    chosen = list(range(len(robots)))
    changed = True
    while changed:
        changed = False
        for one, other in itertools.combinations(range(len(chosen)), 2):
            now = _far(robots[one], places[chosen[one]]) + _far(robots[other], places[chosen[other]])
            then = _far(robots[one], places[chosen[other]]) + _far(robots[other], places[chosen[one]])
            if then < now - 1e-9:  # the margin keeps rounding errors from swapping for ever
                chosen[one], chosen[other] = chosen[other], chosen[one]
                changed = True
    return chosen


def _far(one: Vector3, other: Vector3) -> float:
    """Return the horizontal distance between two points, metres."""
    return (one - other).horizontal()
