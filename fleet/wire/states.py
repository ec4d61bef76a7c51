"""Typed messages for the most frequent reports.

They cost half as much as the same messages as dicts, and are nearly all of an edge's traffic.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import ImuReport, JointReport, PoseReport
from fleet.wire.layouts import MessageSource, joint_messages
from fleet.wire.topics import JOINT_UPDATE

NUDGE = 1e-9  # the SDK's readers take an exact zero or identity for "not given"
ORIGIN, UNTURNED = Vector3(), Quaternion()
NUDGED, NUDGED_TURN = Vector3(x=NUDGE), Quaternion(z=NUDGE)


class Stamped(msgspec.Struct, gc=False):
    """Fields that every message carries, in the order in which they are encoded."""

    source_type: str
    timestamp: float
    session_id: str | UnsetType
    sensor_id: str | UnsetType


class Position(Stamped, gc=False, tag_field="type", tag="position"):
    """``position`` in object form, metres."""

    position: Vector3
    frame_id: str | UnsetType = UNSET


class Rotation(Stamped, gc=False, tag_field="type", tag="rotation"):
    """``rotation`` in object form."""

    rotation: Quaternion
    frame_id: str | UnsetType = UNSET


class JointsMessage(Stamped, gc=False):
    """Joints in the aggregated form, the only one in which no other field can be mistaken for a joint."""

    positions: Mapping[str, float]
    velocities: Mapping[str, float] | UnsetType = UNSET
    efforts: Mapping[str, float] | UnsetType = UNSET


class ImuMessage(Stamped, gc=False):
    """``imu``: rates in rad/s and accelerations in m/s2."""

    gyro: Vector3
    accel: Vector3


StateMessage = Position | Rotation | JointsMessage | ImuMessage


def _pose(report: PoseReport, by: MessageSource) -> list[tuple[str, StateMessage]]:
    """Return the messages for the two topics of a pose."""
    position = NUDGED if report.position == ORIGIN else report.position
    rotation = NUDGED_TURN if report.rotation == UNTURNED else report.rotation
    place = Position(by.source_type, report.stamp, by.session_id, by.sensor_id, position)
    turn = Rotation(by.source_type, report.stamp, by.session_id, by.sensor_id, rotation)
    if report.frame_id:
        place.frame_id = turn.frame_id = report.frame_id
    return [("position", place), ("rotation", turn)]


def _joints(report: JointReport, by: MessageSource) -> Sequence[tuple[str, StateMessage | dict[str, object]]]:
    """Return one message for two topics; none without joints. Other layouts have messages of their own."""
    if not report.positions:
        return []
    if by.layout or report.tags is not None:
        return joint_messages(report, by)
    message = JointsMessage(by.source_type, report.stamp, by.session_id, by.sensor_id, report.positions)
    if report.velocities:
        message.velocities = report.velocities
    if report.efforts:
        message.efforts = report.efforts
    return [(JOINT_UPDATE, message), ("joint_states", message)]


def _imu(report: ImuReport, by: MessageSource) -> list[tuple[str, StateMessage]]:
    """Return the message of an IMU report."""
    message = ImuMessage(by.source_type, report.stamp, by.session_id, by.sensor_id, report.gyro, report.accel)
    return [("imu", message)]


STATES: Mapping[
    type[object], Callable[[Any, MessageSource], Sequence[tuple[str, StateMessage | dict[str, object]]]]
] = {
    PoseReport: _pose,
    JointReport: _joints,
    ImuReport: _imu,
}
"""By type of report, the function that returns its messages: (suffix of the twin's topic, message)."""
