"""What a report may hold: Python itself does not look at the types of its fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, get_args

import msgspec

from fleet.errors import WireError
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import ImuReport, JointReport, PoseReport, Report
from fleet.runtime.decoding import msgpack_decoder
from fleet.wire.encoding import UNSAYABLE

_PACK = msgspec.msgpack.Encoder().encode
_CHECKS: Mapping[type[Any], msgspec.msgpack.Decoder[Any]] = MappingProxyType(
    {kind: msgpack_decoder(kind) for kind in get_args(Report)}
)


def check_report(report: Report) -> None:
    """Raise WireError for a report whose fields are not of their types."""
    plain = _PLAIN.get(type(report))
    if plain is not None and plain(report):
        return
    try:
        _CHECKS[type(report)].decode(_PACK(report))  # no other way that knows every kind is as fast
    except UNSAYABLE as error:
        raise WireError(str(error), where=report.channel) from None


def _plain_pose(report: PoseReport) -> bool:
    """Tell whether all of a pose is floats, and its frame a word."""
    p, r = report.position, report.rotation
    if not (type(p) is Vector3 and type(r) is Quaternion and type(report.stamp) is float):
        return False
    if type(report.frame_id) is not str:
        return False
    return float is type(p.x) is type(p.y) is type(p.z) is type(r.w) is type(r.x) is type(r.y) is type(r.z)


def _plain_imu(report: ImuReport) -> bool:
    """Tell whether all that an IMU measured is floats."""
    g, a = report.gyro, report.accel
    if not (type(g) is type(a) is Vector3 and type(report.stamp) is float):
        return False
    return float is type(g.x) is type(g.y) is type(g.z) is type(a.x) is type(a.y) is type(a.z)


def _plain_joints(report: JointReport) -> bool:
    """Tell whether there are positions and nothing else, all floats with names."""
    positions = report.positions
    if not (
        type(positions) is dict and type(report.stamp) is float and report.velocities == {} == report.efforts
    ):
        return False
    if report.tags is not None:
        return False
    for name, position in positions.items():
        if type(position) is not float or type(name) is not str:
            return False
    return True


_PLAIN: Mapping[type[Any], Callable[[Any], bool]] = {
    PoseReport: _plain_pose,
    ImuReport: _plain_imu,
    JointReport: _plain_joints,
}
"""What is reported most often is nearly always plain: seen in a third to a half of the time."""
