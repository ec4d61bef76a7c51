"""Codec for depth images and point clouds: binary on the bus, with Cyberwave's array header.

The shape in the header must account for every byte; the values themselves are not checked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, cast

from fleet.errors import WireError
from fleet.model.report import DepthReport, PointCloudReport
from fleet.wire.samples import array_parts, array_sample

_BYTES: Mapping[str, int] = MappingProxyType({"uint16": 2, "float32": 4})
LARGEST_SIDE = 1 << 24  # largest plausible dimension of an array


def encode_depth(report: DepthReport, sequence: int) -> bytes:
    """Return a depth image as a sample; raises WireError when its byte count does not fit its size."""
    check_depth(report)
    shape = (report.height, report.width)
    return array_sample(
        report.image,
        stamp=report.stamp,
        sequence=sequence,
        shape=shape,
        dtype=report.dtype,
        sensor=report.sensor,
    )


def check_depth(report: DepthReport) -> None:
    """Raise WireError for an image whose byte count does not fit its width, height and type."""
    _check_size((report.height, report.width), report.dtype, report.image)


def check_pointcloud(report: PointCloudReport) -> None:
    """Raise WireError for bytes that are not a whole number of points."""
    if len(report.points) % (4 * report.stride):
        raise WireError(f"{len(report.points)} bytes are not whole points of {report.stride} numbers")


def decode_depth(sample: bytes) -> DepthReport:
    """Return the depth image in a sample, ``[height, width]`` of uint16 or float32; raises WireError."""
    header, stamp, image = _checked(sample, ("uint16", "float32"))
    shape = header["shape"]
    if len(shape) == 3 and shape[2] == 1:
        shape = shape[:2]
    if len(shape) != 2:
        raise WireError(f"height and width are needed, this is {shape}", where="header.shape")
    return DepthReport(stamp, image, shape[1], shape[0], header["dtype"], _sensor(header))


def encode_pointcloud(report: PointCloudReport, sequence: int) -> bytes:
    """Return a point cloud as a sample; raises WireError unless its bytes are a whole number of points."""
    check_pointcloud(report)
    return array_sample(
        report.points,
        stamp=report.stamp,
        sequence=sequence,
        shape=(len(report.points) // (4 * report.stride), report.stride),
        dtype="float32",
        sensor=report.sensor,
    )


def decode_pointcloud(sample: bytes) -> PointCloudReport:
    """Return the points in a sample: float32 whose last dimension is 3 or 6. Raises WireError."""
    header, stamp, points = _checked(sample, ("float32",))
    shape = header["shape"]
    if len(shape) < 2 or shape[-1] not in (3, 6):
        raise WireError(f"points of 3 or 6 numbers are needed, this is {shape}", where="header.shape")
    return PointCloudReport(stamp, points, shape[-1], _sensor(header))


def _checked(sample: bytes, dtypes: tuple[str, ...]) -> tuple[Mapping[str, Any], float, bytes]:
    """Return header, stamp and bytes of an array, checked: the header must fit the bytes."""
    header, stamp, data = array_parts(sample)
    if not math.isfinite(stamp):
        raise WireError("a finite number is needed", where="header.ts")
    if header.get("dtype") not in dtypes:
        raise WireError(f"one of {', '.join(dtypes)} is needed", where="header.dtype")
    shape = header.get("shape")
    if not isinstance(shape, list) or not 1 <= len(shape) <= 4 or not all(map(_is_side, shape)):
        raise WireError("a list of one to four sizes is needed", where="header.shape")
    _check_size(tuple(shape), header["dtype"], data)
    return header, stamp, data


def _is_side(side: object) -> bool:
    """Return True for a valid dimension of an array."""
    return type(side) is int and 0 < side <= LARGEST_SIDE


def _check_size(shape: tuple[int, ...], dtype: str, data: bytes) -> None:
    """Raise WireError unless the number of bytes is that of the shape."""
    needed = math.prod(shape) * _BYTES[dtype]
    if len(data) != needed:
        raise WireError(f"{list(shape)} of {dtype} are {needed} bytes, not {len(data)}", where="header.shape")


def _sensor(header: Mapping[str, object]) -> str:
    """Return the sensor named in the header, empty when none is."""
    return cast("str", header["sensor_id"]) if isinstance(header.get("sensor_id"), str) else ""
