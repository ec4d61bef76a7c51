"""Polyline path, and a robot's position along it. Pure. Metres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from fleet.host.follow.legs import FlatPoint

CORNER = math.radians(30)  # a sharper turn is driven to its vertex and not cut
AT_CORNER = 0.06  # m before a corner's vertex at which the next piece becomes the target
WINDOW = 1.0  # m ahead in which the robot is searched: a path may cross itself


class Path:
    """Polyline through at least two points; a position on it is the distance from its start."""

    def __init__(self, points: Sequence[FlatPoint]) -> None:
        self._points = tuple(points)
        steps = (math.dist(one, other) for one, other in itertools.pairwise(self._points))
        self._distances = (0.0, *itertools.accumulate(steps))
        self._corners = self._find_corners()

    @property
    def length(self) -> float:
        """Total length."""
        return self._distances[-1]

    @property
    def end(self) -> FlatPoint:
        """The last point."""
        return self._points[-1]

    def passed(self, travelled: float) -> int:
        """Return how many vertices after the first have been passed, not counting the last."""
        return sum(1 for vertex in self._distances[1:-1] if vertex <= travelled + AT_CORNER)

    def ahead(self, here: FlatPoint, travelled: float) -> float:
        """Return the position nearest to ``here``, from ``travelled`` to at most ``WINDOW`` ahead of it."""
        best, nearest = travelled, math.inf
        for number in range(len(self._points) - 1):
            low, high = self._distances[number], self._distances[number + 1]
            if high < travelled or low > travelled + WINDOW or low == high:
                continue
            place = min(max(self._project(here, number), travelled), travelled + WINDOW, self.length)
            apart = math.dist(here, self.point(place))
            if apart < nearest - 1e-9:
                best, nearest = place, apart
        return best

    def point(self, travelled: float) -> FlatPoint:
        """Return the point at a position."""
        for number in range(len(self._points) - 1):
            low, high = self._distances[number], self._distances[number + 1]
            if travelled <= high and high > low:
                part = max(0.0, (travelled - low) / (high - low))
                (x, y), (to_x, to_y) = self._points[number], self._points[number + 1]
                return x + part * (to_x - x), y + part * (to_y - y)
        return self.end

    def aim(self, travelled: float, lookahead: float) -> FlatPoint:
        """Return the point to drive to: ``lookahead`` metres ahead, but not beyond the next corner."""
        corner = next((vertex for vertex in self._corners if vertex > travelled + AT_CORNER), self.length)
        return self.point(min(travelled + lookahead, corner))

    def to_corner(self, travelled: float) -> float:
        """Return the distance to where the robot must slow down: the next corner, or the end."""
        corner = next((vertex for vertex in self._corners if vertex > travelled + AT_CORNER), self.length)
        return max(0.0, corner - travelled)

    def _project(self, here: FlatPoint, number: int) -> float:
        """Return the position on a segment that is nearest to a point."""
        (x, y), (to_x, to_y) = self._points[number], self._points[number + 1]
        low, high = self._distances[number], self._distances[number + 1]
        along = ((here[0] - x) * (to_x - x) + (here[1] - y) * (to_y - y)) / (high - low)
        return low + min(max(along, 0.0), high - low)

    def _find_corners(self) -> tuple[float, ...]:
        """Return the positions of sharp turns."""
        found = []
        for number in range(1, len(self._points) - 1):
            before, at, after = self._points[number - 1 : number + 2]
            turn = _direction(at, after) - _direction(before, at)
            if abs(math.remainder(turn, math.tau)) > CORNER:
                found.append(self._distances[number])
        return tuple(found)


def _direction(one: FlatPoint, other: FlatPoint) -> float:
    """Return the heading from one point to another."""
    return math.atan2(other[1] - one[1], other[0] - one[0])
