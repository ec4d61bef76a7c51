"""Vectors, rotations and poses, and conversions between coordinate frames.

Inside the project: world ENU, body FLU (REP-103). Autopilots use NED and FRD; only the functions here
convert. Vectors, rotations and poses cannot be part of a reference cycle, so the garbage collector does not
track them (``gc=False``): a fleet creates thousands a second.
"""

from __future__ import annotations

import math

import msgspec


class Vector3(msgspec.Struct, frozen=True, gc=False):
    """Three components; the unit is that of the field that holds the vector."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __add__(self, other: Vector3) -> Vector3:
        return Vector3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3) -> Vector3:
        return Vector3(self.x - other.x, self.y - other.y, self.z - other.z)

    def scaled(self, factor: float) -> Vector3:
        """Return this vector times ``factor``."""
        return Vector3(self.x * factor, self.y * factor, self.z * factor)

    def norm(self) -> float:
        """Return the length."""
        return math.sqrt(self.x * self.x + self.y * self.y + self.z * self.z)

    def horizontal(self) -> float:
        """Return the length of the x-y component."""
        return math.hypot(self.x, self.y)


class Quaternion(msgspec.Struct, frozen=True, gc=False):
    """A rotation as a unit quaternion; named components, because wires differ in their order."""

    w: float = 1.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    @property
    def yaw(self) -> float:
        """Heading in radians, counter-clockwise from +x, in (-pi, pi]."""
        return math.atan2(
            2.0 * (self.w * self.z + self.x * self.y),
            1.0 - 2.0 * (self.y * self.y + self.z * self.z),
        )

    @property
    def tilt(self) -> float:
        """Angle between the rotated z axis and the vertical, radians, 0 to pi."""
        up = 1.0 - 2.0 * (self.x * self.x + self.y * self.y)
        return math.acos(max(-1.0, min(1.0, up)))

    def normalized(self) -> Quaternion:
        """Return the unit quaternion; raises ValueError when the length is near zero."""
        norm = math.sqrt(self.w**2 + self.x**2 + self.y**2 + self.z**2)
        if norm < 1e-6:
            raise ValueError("a rotation of length zero has no direction")
        return Quaternion(self.w / norm, self.x / norm, self.y / norm, self.z / norm)


class Pose(msgspec.Struct, frozen=True, gc=False):
    """Position (metres, world ENU) and orientation (body FLU to world) of a robot."""

    position: Vector3 = Vector3()
    rotation: Quaternion = Quaternion()


class Velocity(msgspec.Struct, frozen=True):
    """A body-frame velocity: linear m/s (x forward, y left, z up), yaw rate rad/s, left positive.

    ``gait`` is the gait of a legged robot: walk, trot, or empty for the robot's own choice.
    """

    linear: Vector3 = Vector3()
    yaw_rate: float = 0.0
    gait: str = ""

    @property
    def is_zero(self) -> bool:
        """True when no axis is commanded to move."""
        return self.linear == _AT_REST and self.yaw_rate == 0.0


_AT_REST = Vector3()
ZERO_VELOCITY = Velocity()


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the rotation for intrinsic z-y-x angles in radians (right-handed, any frame)."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return Quaternion(
        w=cr * cp * cy + sr * sp * sy,
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
    )


def quaternion_from_yaw(yaw: float) -> Quaternion:
    """Return the level rotation with this heading (radians, counter-clockwise from +x)."""
    return Quaternion(w=math.cos(yaw / 2), z=math.sin(yaw / 2))


def wrap_angle(angle: float) -> float:
    """Return ``angle`` (radians) wrapped to (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def ned_from_enu(vector: Vector3) -> Vector3:
    """Convert east-north-up to north-east-down; the function is its own inverse."""
    return Vector3(vector.y, vector.x, -vector.z)


def enu_rotation_from_ned(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Convert an autopilot's attitude (FRD body in NED, radians) to FLU body in ENU."""
    return quaternion_from_euler(roll, -pitch, enu_yaw_from_heading(yaw))


def enu_yaw_from_heading(heading: float) -> float:
    """Convert a compass heading (radians clockwise from north) to yaw (radians ccw from east)."""
    return wrap_angle(math.pi / 2 - heading)


def heading_from_enu_yaw(yaw: float) -> float:
    """Convert yaw (radians ccw from east) to a compass heading in [0, 2 pi)."""
    return (math.pi / 2 - yaw) % math.tau


def rotate_to_world(linear: Vector3, yaw: float) -> Vector3:
    """Rotate a vector from the levelled body frame (FLU) into the world (ENU); ``yaw`` in radians."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return Vector3(cos * linear.x - sin * linear.y, sin * linear.x + cos * linear.y, linear.z)
