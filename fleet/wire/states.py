"""The states that robots report most often, as typed messages.

They cost half of what the same messages cost as dicts, and are nearly all that an edge says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import ImuReport, JointReport, PoseReport
from fleet.wire.topics import JOINT_UPDATE

NUDGE = 1e-9  # the SDK's readers take an exact zero or identity for "not given"
ORIGIN, UNTURNED = Vector3(), Quaternion()
NUDGED, NUDGED_TURN = Vector3(x=NUDGE), Quaternion(z=NUDGE)


class Sender(msgspec.Struct, frozen=True):
    """Who says something to the cloud: what all its messages carry.

    ``session_id`` is the edge's client id, ``sensor_id`` the sensor that measured it; left out when unset.
    ``fields``: the same by their names.
    """

    source_type: str
    session_id: str | UnsetType
    sensor_id: str | UnsetType
    fields: Mapping[str, str]


class Stamped(msgspec.Struct, gc=False):
    """What every message carries, in the order in which it is given."""

    source_type: str
    timestamp: float
    session_id: str | UnsetType
    sensor_id: str | UnsetType


class Position(Stamped, gc=False, tag_field="type", tag="position"):
    """``position`` in object form, metres."""

    position: Vector3


class Rotation(Stamped, gc=False, tag_field="type", tag="rotation"):
    """``rotation`` in object form."""

    rotation: Quaternion


class Joints(Stamped, gc=False):
    """The aggregated form of joints, the only one in which no other field can pass for a joint."""

    positions: Mapping[str, float]
    velocities: Mapping[str, float] | UnsetType = UNSET
    efforts: Mapping[str, float] | UnsetType = UNSET


class Imu(Stamped, gc=False):
    """``imu``: rates in rad/s and accelerations in m/s2."""

    gyro: Vector3
    accel: Vector3


State = Position | Rotation | Joints | Imu


def _pose(report: PoseReport, by: Sender) -> list[tuple[str, State]]:
    """Make the messages of the two topics that a pose has."""
    position = NUDGED if report.position == ORIGIN else report.position
    rotation = NUDGED_TURN if report.rotation == UNTURNED else report.rotation
    return [
        ("position", Position(by.source_type, report.stamp, by.session_id, by.sensor_id, position)),
        ("rotation", Rotation(by.source_type, report.stamp, by.session_id, by.sensor_id, rotation)),
    ]


def _joints(report: JointReport, by: Sender) -> list[tuple[str, State]]:
    """Make one message for two topics; nothing without a joint."""
    if not report.positions:
        return []
    message = Joints(by.source_type, report.stamp, by.session_id, by.sensor_id, report.positions)
    if report.velocities:
        message.velocities = report.velocities
    if report.efforts:
        message.efforts = report.efforts
    return [(JOINT_UPDATE, message), ("joint_states", message)]


def _imu(report: ImuReport, by: Sender) -> list[tuple[str, State]]:
    """Make the one message of what an IMU measured."""
    message = Imu(by.source_type, report.stamp, by.session_id, by.sensor_id, report.gyro, report.accel)
    return [("imu", message)]


STATES: Mapping[type[Any], Callable[[Any, Sender], list[tuple[str, State]]]] = {
    PoseReport: _pose,
    JointReport: _joints,
    ImuReport: _imu,
}
"""By kind of report, what makes its messages: (leaf of the twin's topic, message)."""
