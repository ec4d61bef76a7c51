"""Fence of one robot: the positions, paths and velocities that it allows.

Pure. Points are metres in the robot's world frame, heights metres above home. Paths are straight: one must
not cross an exclusion or leave the inclusions, even if both of its ends are allowed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import msgspec

from fleet.model.geometry import Vector3, rotate_to_world
from fleet.model.polygon import Polygon, PolygonPoint, crosses, distance_to_border, polygon_contains

SLACK = 1.0  # m out of bounds that count as position noise and overshoot
STEP = 0.1  # m of a first small step of motion
_PART, _MOST_PARTS = 0.5, 400  # m between the points at which a way back inside is judged, and their number
_ROUNDING = 1e-6  # m
LOOK_AHEAD = 1.5  # s of motion that must stay inside: age of the pose, reaction time and braking


class Fence(msgspec.Struct, frozen=True):
    """Fence geometry. The robot must be in an ``inclusion``, if there are any, and in no ``exclusion``.

    ``ceiling`` is metres above home, ``distance`` metres from home; None is no limit. ``margin`` is the
    additional distance in metres that a held velocity keeps from the border.
    """

    inclusion: tuple[Polygon, ...] = ()
    exclusion: tuple[Polygon, ...] = ()
    ceiling: float | None = None
    distance: float | None = None
    margin: float = 1.0

    def trouble(self, point: Vector3, home: Vector3, around: float = 0.0) -> str:
        """Return why the robot may not be at a point, or circle it at ``around`` metres; empty if it may."""
        trouble = self._trouble(point, home)
        if trouble or not around:
            return trouble
        flat = (point.x, point.y)
        borders = [distance_to_border(each, flat) for each in self.exclusion]
        if self.inclusion:
            homes = [each for each in self.inclusion if polygon_contains(each, flat)]
            borders.append(max(distance_to_border(each, flat) for each in homes))
        if self.distance is not None:
            borders.append(self.distance - _away(point, home))
        left = min(borders, default=math.inf)
        return f"{left:.0f} m from the fence, and it circles {around:.0f} m about it" if left < around else ""

    def _trouble(self, point: Vector3, home: Vector3) -> str:
        """Return why the robot may not be at a point; empty when it may."""
        flat = (point.x, point.y)
        if any(polygon_contains(polygon, flat) for polygon in self.exclusion):
            return "in an exclusion of the fence"
        if self.inclusion and not any(polygon_contains(polygon, flat) for polygon in self.inclusion):
            return "outside the fence"
        away = _away(point, home)
        if self.distance is not None and away > self.distance:
            return f"{away:.0f} m from home, the limit is {self.distance:g} m"
        height = point.z - home.z
        if self._is_high(height):
            return f"{height:.1f} m above home, the limit is {self.ceiling:g} m"
        return ""

    def breach(self, point: Vector3, home: Vector3) -> str:
        """Return why a robot at a point has breached the fence; empty when it has not."""
        over = -math.inf if self.ceiling is None else point.z - home.z - self.ceiling
        return self.trouble(point, home) if max(over, self._beyond(point, home)) > SLACK else ""

    def route_trouble(
        self, start: Vector3, points: Iterable[Vector3], home: Vector3, around: Iterable[float] = ()
    ) -> str:
        """Return why a robot may not go from ``start`` through these points; empty when it may.

        A robot that is outside already may come in: straight, never farther out than before, and through no
        other forbidden ground. ``around``: circling radius at each point, metres.
        """
        outside, wide = self.trouble(start, home), iter(around)
        for number, point in enumerate(points, 1):
            trouble = self.trouble(point, home, next(wide, 0.0))
            if trouble:
                return f"goal {number} is {trouble}"
            if outside and not self._comes_in(start, point, home):
                return f"it is {outside}, and the straight way to goal {number} does not lead back by itself"
            if not outside and self._leaves((start.x, start.y), (point.x, point.y)):
                return f"the straight way to goal {number} leads out of the fence"
            start, outside = point, ""
        return ""

    def _comes_in(self, start: Vector3, end: Vector3, home: Vector3) -> bool:
        """Return whether a straight path from outside to an allowed point only ever leads back inside."""
        if self._enters(start, end):
            return False
        count = min(_MOST_PARTS, max(2, math.ceil((end - start).norm() / _PART)))
        samples = [start + (end - start).scaled(number / count) for number in range(count + 1)]
        out = [self._beyond(point, home) for point in samples]
        return all(later <= sooner + _ROUNDING for sooner, later in itertools.pairwise(out))

    def _enters(self, start: Vector3, end: Vector3) -> bool:
        """Return whether a straight path touches an exclusion in which it does not begin."""
        here, there = (start.x, start.y), (end.x, end.y)
        return any(
            not polygon_contains(polygon, here) and crosses(polygon, here, there)
            for polygon in self.exclusion
        )

    def _leaves(self, start: PolygonPoint, end: PolygonPoint) -> bool:
        """Return whether a straight path between two allowed points crosses forbidden ground."""
        if any(crosses(polygon, start, end) for polygon in self.exclusion):
            return True
        homes = [polygon for polygon in self.inclusion if polygon_contains(polygon, start)]
        return bool(homes) and all(crosses(polygon, start, end) for polygon in homes)

    @property
    def has_border(self) -> bool:
        """Whether it limits the place, and not the height alone."""
        return bool(self.inclusion or self.exclusion) or self.distance is not None

    def admitted(self, point: Vector3, velocity: Vector3, home: Vector3, heading: float = 0.0) -> Vector3:
        """Return the part of a velocity (m/s) that keeps the robot inside or brings it back.

        Its frame is the world, turned by ``heading``. A robot outside does not climb: it comes back, or
        lands.
        """
        climb, bordered = velocity.z, self.has_border
        high = climb > 0 and self._is_high(point.z - home.z + climb * LOOK_AHEAD)
        if high or (climb > 0 and bordered and self._beyond(point, home) > SLACK):
            climb = 0.0
        if bordered and self._worse(point, rotate_to_world(velocity, heading), home):
            return Vector3(0.0, 0.0, climb)
        return Vector3(velocity.x, velocity.y, climb)

    def _worse(self, point: Vector3, velocity: Vector3, home: Vector3) -> bool:
        """Return whether the horizontal part of a world velocity leads out, or farther out."""
        speed = velocity.horizontal()
        if speed == 0:
            return False
        # The first small step counts: a robot outside must not go deeper first, even if its path ends inside.
        steps = (STEP / speed, LOOK_AHEAD, LOOK_AHEAD + self.margin / speed)
        positions = [point + Vector3(velocity.x, velocity.y, 0.0).scaled(seconds) for seconds in steps]
        beyond = max(self._beyond(ahead, home) for ahead in positions)
        before = self._beyond(point, home)
        if before == 0:
            return beyond > 0 or self._leaves((point.x, point.y), (positions[-1].x, positions[-1].y))
        return beyond >= before or self._enters(point, positions[-1])

    def _is_high(self, height: float) -> bool:
        """Return whether a height above home is above the ceiling."""
        return self.ceiling is not None and height > self.ceiling

    def _beyond(self, point: Vector3, home: Vector3) -> float:
        """Return the metres by which a point is out of bounds, 0 inside."""
        flat = (point.x, point.y)
        worst = [distance_to_border(each, flat) for each in self.exclusion if polygon_contains(each, flat)]
        if self.inclusion and not any(polygon_contains(polygon, flat) for polygon in self.inclusion):
            worst.append(min(distance_to_border(polygon, flat) for polygon in self.inclusion))
        if self.distance is not None:
            worst.append(_away(point, home) - self.distance)
        return max(0.0, *worst) if worst else 0.0


def _away(point: Vector3, home: Vector3) -> float:
    """Return the horizontal distance between two points, m."""
    return math.hypot(point.x - home.x, point.y - home.y)
