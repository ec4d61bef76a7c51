"""Codec for reports on the bus, in Cyberwave's own format, which its SDK reads and writes.

Payloads that the SDK documents (position, joint_states, battery, imu) have its shape; gps and event use the
field names of their MQTT topics; depth and pointcloud are arrays; every other channel has the fields of
its report, with ``ts`` for the stamp. Three of these are also accepted in their MQTT form
(``fleet.wire.published``). The framing is that of ``fleet.wire.samples``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Generic, TypeVar, get_args

import msgspec

from fleet.errors import WireError
from fleet.model.event import EventReport
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    GpsReport,
    ImuReport,
    JointReport,
    JointTags,
    PointCloudReport,
    PoseReport,
    Report,
)
from fleet.runtime.decoding import json_decoder
from fleet.wire.arrays import decode_depth, decode_pointcloud, encode_depth, encode_pointcloud
from fleet.wire.encoding import encode_finite
from fleet.wire.events import EventDocument
from fleet.wire.published import ENVELOPE, PUBLISHED, decode_published, object_in
from fleet.wire.samples import json_payload, json_sample

ReportT = TypeVar("ReportT", bound=Report)


class _Vector(msgspec.Struct, frozen=True):
    """A vector; all three components are required."""

    x: float
    y: float
    z: float

    @classmethod
    def of(cls, vector: Vector3) -> _Vector:
        return cls(vector.x, vector.y, vector.z)

    def vector(self) -> Vector3:
        return Vector3(self.x, self.y, self.z)


class _BusPosition(msgspec.Struct, frozen=True, omit_defaults=True):
    """``position``: metres in the world, and a quaternion."""

    ts: float
    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float
    frame_id: str = ""

    @classmethod
    def of(cls, report: PoseReport) -> _BusPosition:
        p, r = report.position, report.rotation
        return cls(report.stamp, p.x, p.y, p.z, r.x, r.y, r.z, r.w, report.frame_id)

    def report(self) -> PoseReport:
        rotation = Quaternion(self.qw, self.qx, self.qy, self.qz)
        return PoseReport(self.ts, Vector3(self.x, self.y, self.z), rotation, self.frame_id)


class _Joints(JointTags, frozen=True, omit_defaults=True, kw_only=True):
    """``joint_states``: arrays in the order of ``names``; null where a joint has no value."""

    ts: float
    names: list[str]
    positions: list[float]
    velocities: list[float | None] = msgspec.field(default_factory=list)
    efforts: list[float | None] = msgspec.field(default_factory=list)

    @classmethod
    def of(cls, report: JointReport) -> _Joints:
        names = list(report.positions)
        return cls(
            ts=report.stamp,
            names=names,
            positions=list(report.positions.values()),
            velocities=_aligned(names, report.velocities, "velocities"),
            efforts=_aligned(names, report.efforts, "efforts"),
            **(msgspec.structs.asdict(report.tags) if report.tags is not None else {}),
        )

    def report(self) -> JointReport:
        positions = dict(zip(self.names, self.positions, strict=True))
        if len(positions) != len(self.names):
            raise ValueError("a joint is named twice")
        tags = JointTags(*(getattr(self, name) for name in JointTags.__struct_fields__))
        return JointReport(
            self.ts,
            positions,
            self._by_name(self.velocities),
            self._by_name(self.efforts),
            None if tags == _UNTAGGED else tags,
        )

    def _by_name(self, values: list[float | None]) -> dict[str, float]:
        if not values:
            return {}
        pairs = zip(self.names, values, strict=True)
        return {name: value for name, value in pairs if value is not None}


_UNTAGGED = JointTags()


def _aligned(names: list[str], values: Mapping[str, float], what: str) -> list[float | None]:
    """Return values in the order of ``names``, empty when there are none."""
    if not values:
        return []
    if unknown := values.keys() - set(names):
        raise WireError(f"{min(unknown)!a} has no position", where=what)
    return [values.get(name) for name in names]


class _Battery(msgspec.Struct, frozen=True, omit_defaults=True):
    """``battery``: volts, amperes out, percent."""

    ts: float
    voltage_v: float | None = None
    current_a: float | None = None
    charge_pct: float | None = None

    @classmethod
    def of(cls, report: BatteryReport) -> _Battery:
        return cls(report.stamp, report.voltage, report.current, report.percent)

    def report(self) -> BatteryReport:
        return BatteryReport(self.ts, self.charge_pct, self.voltage_v, self.current_a)


class _Imu(msgspec.Struct, frozen=True):
    """``imu``: m/s2 and rad/s in the body frame."""

    ts: float
    accel: _Vector
    gyro: _Vector

    @classmethod
    def of(cls, report: ImuReport) -> _Imu:
        return cls(report.stamp, _Vector.of(report.accel), _Vector.of(report.gyro))

    def report(self) -> ImuReport:
        return ImuReport(self.ts, self.gyro.vector(), self.accel.vector())


class _Gps(msgspec.Struct, frozen=True, omit_defaults=True):
    """``gps``: degrees and metres, with the field names of the MQTT topic; no position without a fix."""

    ts: float
    fix_type: str
    latitude: float | None = None
    longitude: float | None = None
    altitude: float | None = None
    satellite_count: int | None = None
    compass_heading: float | None = None
    horizontal_accuracy: float | None = None
    vertical_accuracy: float | None = None

    @classmethod
    def of(cls, report: GpsReport) -> _Gps:
        point = report.point
        return cls(
            report.stamp,
            report.fix_type,
            point.latitude if point else None,
            point.longitude if point else None,
            point.altitude if point else None,
            report.satellites,
            report.heading,
            report.horizontal_accuracy,
            report.vertical_accuracy,
        )

    def report(self) -> GpsReport:
        point = None
        if self.latitude is not None and self.longitude is not None:
            point = GeoPoint(self.latitude, self.longitude, self.altitude or 0.0)
        return GpsReport(
            self.ts,
            point,
            self.fix_type,
            self.satellite_count,
            self.compass_heading,
            self.horizontal_accuracy,
            self.vertical_accuracy,
        )


class _ChannelCodec(msgspec.Struct, Generic[ReportT], frozen=True):
    """Codec of one channel: conversion between its reports and their form on the bus."""

    to_wire: Callable[[Any], Any]
    from_wire: Callable[[Any], Report]
    decoder: msgspec.json.Decoder[Any]
    names: frozenset[str]


def _shaped(shape: Any) -> _ChannelCodec[Any]:
    """Return the codec of a channel whose payload has its own struct."""
    return _ChannelCodec(
        shape.of, shape.report, json_decoder(shape), frozenset(shape.__struct_encode_fields__)
    )


def _as_it_is(kind: Any) -> _ChannelCodec[Any]:
    """Return the codec of a channel whose payload has the fields of its report, ``stamp`` renamed ``ts``."""
    fields = [_same_field(field) for field in msgspec.structs.fields(kind)]
    shape = msgspec.defstruct(f"_{kind.__name__}", fields, frozen=True, rename={"stamp": "ts"})
    return _ChannelCodec(
        lambda report: shape(*msgspec.structs.astuple(report)),
        lambda wire: kind(*msgspec.structs.astuple(wire)),
        json_decoder(shape),
        frozenset(shape.__struct_encode_fields__),
    )


def _same_field(field: msgspec.structs.FieldInfo) -> tuple[str, object] | tuple[str, object, object]:
    """Return the ``defstruct`` definition of a field with the same name, type and default."""
    if field.required:
        return field.name, field.type
    if field.default is msgspec.NODEFAULT:
        return field.name, field.type, msgspec.field(default_factory=field.default_factory)
    return field.name, field.type, field.default


_SHAPES: Mapping[type[object], type[object]] = {
    PoseReport: _BusPosition,
    JointReport: _Joints,
    BatteryReport: _Battery,
    ImuReport: _Imu,
    GpsReport: _Gps,
    EventReport: EventDocument,
}

_ARRAYS: Mapping[str, tuple[Callable[[Any, int], bytes], Callable[[bytes], Report]]] = MappingProxyType(
    {
        DepthReport.channel: (encode_depth, decode_depth),
        PointCloudReport.channel: (encode_pointcloud, decode_pointcloud),
    }
)

_CODECS: Mapping[str, _ChannelCodec[Any]] = MappingProxyType(
    {
        kind.channel: _shaped(_SHAPES[kind]) if kind in _SHAPES else _as_it_is(kind)
        for kind in get_args(Report)
        if kind.channel not in _ARRAYS
    }
)


def encode_report(report: Report, sequence: int) -> bytes:
    """Return a report as a sample of its channel.

    Raises WireError for a number that is not finite, and for an array whose byte count is not its size.
    """
    if report.channel in _ARRAYS:
        return _ARRAYS[report.channel][0](report, sequence)
    payload = encode_finite(_CODECS[report.channel].to_wire(report))
    return json_sample(payload, stamp=report.stamp, sequence=sequence)


def decode_report(channel: str, sample: bytes) -> Report:
    """Decode a sample, with header or as plain JSON; raises WireError for anything else."""
    if channel in PUBLISHED:
        return decode_published(channel, sample)
    codec = _CODECS.get(channel)
    if codec is None:
        return _decode_array(channel, sample)
    try:
        return codec.from_wire(codec.decoder.decode(json_payload(sample)))
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise WireError(str(error), where=channel) from None


def unread_fields(channel: str, sample: bytes) -> list[str]:
    """Return the fields of a sample that ``decode_report`` ignores; empty for a sample that it refuses."""
    codec = None if channel in PUBLISHED else _CODECS.get(channel)
    if codec is None:
        return []
    try:
        message = object_in(sample, channel)
    except WireError:
        return []
    return sorted(message.keys() - codec.names - ENVELOPE)


def _decode_array(channel: str, sample: bytes) -> Report:
    """Decode a binary sample."""
    if channel not in _ARRAYS:
        raise WireError(f"no report has the channel {channel[:60]!a}")
    return _ARRAYS[channel][1](sample)
