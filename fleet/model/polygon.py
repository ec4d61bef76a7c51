"""Closed polygons on the plane: inside, crossing, distance. Points are (x, y) in metres; pure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

PolygonPoint = tuple[float, float]
Polygon = tuple[PolygonPoint, ...]
PolygonEdge = tuple[PolygonPoint, PolygonPoint]


def edges(polygon: Polygon) -> Iterator[PolygonEdge]:
    """Yield the sides; the last one returns to the first corner."""
    return itertools.pairwise((*polygon, polygon[0]))


def polygon_contains(polygon: Polygon, point: PolygonPoint) -> bool:
    """Return whether a point is inside; for a point on the border the result is undefined."""
    # Ray casting: a ray towards +x crosses the border an odd number of times from inside.
    x, y = point
    inside = False
    for (ax, ay), (bx, by) in edges(polygon):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            inside = not inside
    return inside


def distance_to_border(polygon: Polygon, point: PolygonPoint) -> float:
    """Return the distance to the nearest side, metres, from inside or outside."""
    return min(_distance(edge, point) for edge in edges(polygon))


def _distance(edge: PolygonEdge, point: PolygonPoint) -> float:
    """Return the distance from a point to a side, metres."""
    (ax, ay), (bx, by) = edge
    dx, dy = bx - ax, by - ay
    length = dx * dx + dy * dy
    along = ((point[0] - ax) * dx + (point[1] - ay) * dy) / length if length > 0 else 0.0
    along = max(0.0, min(1.0, along))
    return math.hypot(point[0] - ax - along * dx, point[1] - ay - along * dy)


def crosses(polygon: Polygon, start: PolygonPoint, end: PolygonPoint) -> bool:
    """Return whether the straight line from ``start`` to ``end`` touches or crosses a side."""
    return any(_meet((start, end), edge) for edge in edges(polygon))


def is_simple(polygon: Polygon) -> bool:
    """Return whether the polygon has an area and no two of its sides touch, except neighbours."""
    sides = list(edges(polygon))
    if any(start == end for start, end in sides) or abs(_area(polygon)) <= 0.0:
        return False
    for first, second in itertools.combinations(range(len(sides)), 2):
        neighbours = second - first in {1, len(sides) - 1}
        if not neighbours and _meet(sides[first], sides[second]):
            return False
    return True


def centroid(polygon: Polygon) -> PolygonPoint:
    """Return the centroid of the area, which may be outside a polygon that is not convex."""
    ox, oy = polygon[0]  # relative to a corner: far from the origin the products would lose precision
    x = y = doubled = 0.0
    for (ax, ay), (bx, by) in edges(tuple((cx - ox, cy - oy) for cx, cy in polygon)):
        cross = ax * by - bx * ay
        doubled += cross
        x += (ax + bx) * cross
        y += (ay + by) * cross
    return ox + x / (3 * doubled), oy + y / (3 * doubled)


def _area(polygon: Polygon) -> float:
    """Return the signed area, square metres."""
    return sum(ax * by - bx * ay for (ax, ay), (bx, by) in edges(polygon)) / 2


def _meet(one: PolygonEdge, other: PolygonEdge) -> bool:
    """Return whether two line segments touch or cross."""
    orientations = (
        _orientation(one[0], one[1], other[0]),
        _orientation(one[0], one[1], other[1]),
        _orientation(other[0], other[1], one[0]),
        _orientation(other[0], other[1], one[1]),
    )
    if orientations[0] * orientations[1] < 0 and orientations[2] * orientations[3] < 0:
        return True
    ends = ((one, other[0]), (one, other[1]), (other, one[0]), (other, one[1]))
    return any(
        orientation == 0 and _between(edge, point)
        for orientation, (edge, point) in zip(orientations, ends, strict=True)
    )


def _orientation(a: PolygonPoint, b: PolygonPoint, c: PolygonPoint) -> float:
    """Return the side of the line from a to b on which c lies: positive left, negative right, 0 on it."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _between(edge: PolygonEdge, point: PolygonPoint) -> bool:
    """Return whether a point that is collinear with an edge lies between its ends."""
    (ax, ay), (bx, by) = edge
    return min(ax, bx) <= point[0] <= max(ax, bx) and min(ay, by) <= point[1] <= max(ay, by)
