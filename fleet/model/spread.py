"""Places for several robots around one point, and who goes to which; pure, metres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fleet.model.geometry import Vector3


def spread(number: int, spacing: float) -> tuple[Vector3, ...]:
    """Return where ``number`` robots stand on a square grid around nought, ``spacing`` from each other."""
    columns = math.ceil(math.sqrt(number))
    rows = math.ceil(number / columns)
    return tuple(
        Vector3((at % columns - (columns - 1) / 2) * spacing, ((rows - 1) / 2 - at // columns) * spacing)
        for at in range(number)
    )


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
