"""How near two broken lines in space come to each other; metres, pure.

A line is the points that it leads through, one at the least: a single point is a line of no length.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fleet.model.geometry import Vector3

Line = Sequence[Vector3]


def apart(one: Line, other: Line, best: float = math.inf) -> float:
    """Return the least distance between two lines, or ``best`` where that is less.

    Long lines are halved, and halves whose boxes are too far from each other are not looked into.
    """
    if _boxes_apart(one, other) >= best:
        return best
    if len(one) <= 2 and len(other) <= 2:
        return min(best, _sections(one[0], one[-1], other[0], other[-1]))
    longer, shorter = (one, other) if len(one) >= len(other) else (other, one)
    middle = len(longer) // 2
    best = apart(longer[: middle + 1], shorter, best)
    return apart(longer[middle:], shorter, best)


def length(line: Line) -> float:
    """Return metres along a line."""
    return sum((later - sooner).norm() for sooner, later in itertools.pairwise(line))


def beginning(line: Line, metres: float) -> tuple[Vector3, ...]:
    """Return the first ``metres`` of a line."""
    taken = [line[0]]
    for sooner, later in itertools.pairwise(line):
        step = later - sooner
        along = step.norm()
        if along >= metres:
            taken.append(sooner + step.scaled(metres / along if along > 0 else 0.0))
            break
        taken.append(later)
        metres -= along
    return tuple(taken)


def _boxes_apart(one: Line, other: Line) -> float:
    """Return metres between the upright boxes around two lines: never more than between the lines."""
    gaps = (
        _gap([point.x for point in one], [point.x for point in other]),
        _gap([point.y for point in one], [point.y for point in other]),
        _gap([point.z for point in one], [point.z for point in other]),
    )
    return math.hypot(*gaps)


def _gap(one: list[float], other: list[float]) -> float:
    """Return how far two ranges are from each other, 0 where they meet."""
    return max(0.0, min(other) - max(one), min(one) - max(other))


def _sections(a: Vector3, b: Vector3, c: Vector3, d: Vector3) -> float:
    """Return the least distance between the sections a-b and c-d (Ericson, Real-Time Collision Detection)."""
    along, across, between = b - a, d - c, a - c
    aa, bb, ab = _dot(along, along), _dot(across, across), _dot(along, across)
    ca, cb = _dot(along, between), _dot(across, between)
    lean = aa * bb - ab * ab
    s = _share(ab * cb - ca * bb, lean) if lean > 1e-12 * aa * bb else 0.0
    t = (ab * s + cb) / bb if bb > 0 else 0.0
    if not 0.0 <= t <= 1.0 or bb <= 0:
        t = min(max(t, 0.0), 1.0)
        s = _share(ab * t - ca, aa)
    return (between + along.scaled(s) - across.scaled(t)).norm()


def _share(part: float, whole: float) -> float:
    """Return a quotient within 0 to 1; 0 for a section of no length."""
    return min(max(part / whole, 0.0), 1.0) if whole > 0 else 0.0


def _dot(one: Vector3, other: Vector3) -> float:
    """Return the scalar product."""
    return one.x * other.x + one.y * other.y + one.z * other.z
