"""Conversion of an autopilot's position and attitude to the world frame (ENU around an origin, REP-103)."""

from __future__ import annotations

import math

from fleet import GeoOrigin, Pose, Vector3, enu_rotation_from_ned, world_from_geo
from fleet_mavlink.state import VehicleState


def origin_of(state: VehicleState) -> GeoOrigin | None:
    """Return a world origin at the vehicle's home, None while home is unknown.

    A vehicle on ground or water is at z = 0 there, because the altitude of its home is unreliable.
    """
    altitude = state.home_altitude
    if state.on_the_surface and state.position is not None:
        altitude = state.position.altitude
    if state.home is None or altitude is None:
        return None
    return GeoOrigin(state.home.latitude, state.home.longitude, altitude)


def pose_of(state: VehicleState, origin: GeoOrigin) -> Pose | None:
    """Return the vehicle's pose, None while position or attitude is unknown."""
    if state.position is None or state.attitude is None:
        return None
    angles = state.attitude
    # The world's +y axis points to ``origin.heading``, not north.
    heading = angles.yaw - math.radians(origin.heading)
    return Pose(
        position=world_from_geo(origin, state.position),
        rotation=enu_rotation_from_ned(angles.roll, angles.pitch, heading),
    )


def flu_from_frd(vector: Vector3) -> Vector3:
    """Convert a body vector from FRD (forward, right, down) to FLU (forward, left, up)."""
    return Vector3(vector.x, -vector.y, -vector.z)
