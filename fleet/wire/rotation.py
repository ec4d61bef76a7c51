"""Reader of rotations in messages; list rotations occur in two component orders."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from fleet.errors import WireError
from fleet.model.geometry import Quaternion
from fleet.wire.strict_json import finite, number

QuaternionOrder = Literal["wxyz", "xyzw"]

LARGEST_TILT = math.radians(20)  # tolerated tilt of a goal for a robot that cannot tilt
LENGTH_ERROR = 0.05  # tolerated deviation of a quaternion's length from 1


def yaw_of(value: object, *, order: QuaternionOrder, planar: bool, where: str) -> float:
    """Return the yaw (radians) of {w, x, y, z}, or of a list in the given order.

    Raises WireError unless it is a unit quaternion and, when ``planar``, for a tilt of more than 20 degrees:
    most often the list is then in the other order.
    """
    rotation = _rotation(value, order, where)
    length = math.hypot(rotation.w, rotation.x, rotation.y, rotation.z)
    if abs(length - 1) > LENGTH_ERROR:
        raise WireError(f"a rotation has length 1, this one {length:.3g}", where=where)
    unit = rotation.normalized()
    if planar and unit.tilt > LARGEST_TILT:
        degrees = math.degrees(unit.tilt)
        raise WireError(f"tilts by {degrees:.0f} degrees; is its order {' '.join(order)}?", where=where)
    return unit.yaw


def _rotation(value: object, order: QuaternionOrder, where: str) -> Quaternion:
    """Return the four components, by name or by position."""
    if isinstance(value, dict):
        return _by_name(value, where)
    if not isinstance(value, list) or len(value) != 4:
        raise WireError(f"w, x, y, z by name or four numbers {' '.join(order)} are needed", where=where)
    numbers = [finite(item, f"{where}.{index}") for index, item in enumerate(value)]
    return Quaternion(**dict(zip(order, numbers, strict=True)))


def _by_name(value: Mapping[str, object], where: str) -> Quaternion:
    """Return a rotation from named components; all four are required."""
    return Quaternion(*(number(value, name, where) for name in "wxyz"))
