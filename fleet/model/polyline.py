"""Distances between polylines in space; metres, pure.

A line is the sequence of its points, at least one: a single point is a line of length zero.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fleet.model.geometry import Vector3

Line = Sequence[Vector3]
FEW = 36  # up to so many pairs of points, comparing all is cheaper than comparing bounding boxes first


def apart(one: Line, other: Line, best: float = math.inf) -> float:
    """Return the least distance between two lines, or ``best`` where that is less.

    Long lines are halved recursively; halves whose bounding boxes are at least ``best`` apart are skipped.
    """
    if len(one) * len(other) <= FEW:
        return min(best, *(_sections(*a, *b) for a in _pieces(one) for b in _pieces(other)))
    if _boxes_apart(one, other) >= best:
        return best
    longer, shorter = (one, other) if len(one) >= len(other) else (other, one)
    middle = len(longer) // 2
    best = apart(longer[: middle + 1], shorter, best)
    return apart(longer[middle:], shorter, best)


def _pieces(line: Line) -> list[tuple[Vector3, Vector3]]:
    """Return the segments of a line; a single point gives one of length zero."""
    return list(itertools.pairwise(line)) if len(line) > 1 else [(line[0], line[0])]


def length(line: Line) -> float:
    """Return the length of a line, metres."""
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
    """Return the distance between the axis-aligned bounding boxes of two lines: a lower bound of theirs."""
    gaps = (
        _gap([point.x for point in one], [point.x for point in other]),
        _gap([point.y for point in one], [point.y for point in other]),
        _gap([point.z for point in one], [point.z for point in other]),
    )
    return math.hypot(*gaps)


def _gap(one: list[float], other: list[float]) -> float:
    """Return the distance between two ranges of numbers, 0 where they overlap."""
    return max(0.0, min(other) - max(one), min(one) - max(other))


def _sections(a: Vector3, b: Vector3, c: Vector3, d: Vector3) -> float:
    """Return the least distance between the segments a-b and c-d (Ericson, Real-Time Collision Detection).

    Written in plain floats, without Vector3: it is called thousands of times a second.
    """
    ux, uy, uz = b.x - a.x, b.y - a.y, b.z - a.z
    vx, vy, vz = d.x - c.x, d.y - c.y, d.z - c.z
    wx, wy, wz = a.x - c.x, a.y - c.y, a.z - c.z
    uu, vv, uv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    lean = uu * vv - uv * uv
    s = min(max((uv * vw - uw * vv) / lean, 0.0), 1.0) if lean > 1e-12 * uu * vv else 0.0
    t = (uv * s + vw) / vv if vv > 0.0 else -1.0
    if not 0.0 <= t <= 1.0:
        t = 1.0 if t > 1.0 else 0.0
        s = min(max((uv * t - uw) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
    return math.hypot(wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz)
