import json

import numpy as np
import pytest
from cyberwave.data.header import HeaderMeta, decode, encode
from cyberwave.twin.sensors.pointcloud import _decode_pointcloud

from fleet.errors import WireError
from fleet.model.report import DepthReport, PointCloudReport
from fleet.wire.arrays import decode_depth, decode_pointcloud, encode_depth, encode_pointcloud
from fleet.wire.reports import sender, to_mqtt


def array(values, dtype=None, **metadata):
    """Return an array as the SDK puts it on the bus."""
    found = np.asarray(values, dtype=dtype)
    header = HeaderMeta("numpy/ndarray", 5.0, 1, found.shape, str(found.dtype), metadata or None)
    return encode(header, found.tobytes())


def test_a_depth_image_of_the_sdk_is_read():
    report = decode_depth(array([[1, 2, 3], [4, 5, 6]], "uint16", sensor_id="front"))
    assert (report.width, report.height, report.dtype, report.stamp) == (3, 2, "uint16", 5.0)
    assert (report.image, report.sensor) == (np.arange(1, 7, dtype="<u2").tobytes(), "front")
    assert decode_depth(array(np.zeros((2, 3, 1)), "float32")).width == 3


def test_the_sdk_reads_a_depth_image_of_ours():
    header, payload = decode(encode_depth(DepthReport(5.0, b"12345678", 2, 2, "uint16", "front"), 3))
    assert (header.content_type, header.shape, header.dtype) == ("numpy/ndarray", (2, 2), "uint16")
    assert (header.seq, header.metadata, payload) == (3, {"sensor_id": "front"}, b"12345678")


@pytest.mark.parametrize(("shape", "rows", "stride"), [((7, 3), 7, 3), ((7, 6), 7, 6), ((2, 4, 3), 8, 3)])
def test_points_of_the_sdk_are_read_and_come_back_to_it_over_mqtt(shape, rows, stride):
    points = np.arange(np.prod(shape), dtype="float32").reshape(shape)
    report = decode_pointcloud(array(points))
    ((suffix, payload),) = to_mqtt(report, sender(source_type="edge", session="us"))
    assert (suffix, report.stride) == ("pointcloud", stride)
    message = json.loads(payload)
    assert (message["rows"], message["cols"], message["point_stride"]) == (rows, stride, stride)
    seen = _decode_pointcloud(message)
    assert np.asarray(seen).reshape(-1)[:3].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    "sample",
    [
        b"",
        b"{}",
        array([1, 2, 3], "uint16"),
        array([[1, 2]], "int32"),
        array([[[[1, 2]]]], "uint16"),
        array([[1, 2]], "uint16")[:-1],
        array([[1, 2]], "uint16") + b"x",
        encode(HeaderMeta("numpy/ndarray", 5.0, 1, (2, -1), "uint16"), b""),
        encode(HeaderMeta("numpy/ndarray", 5.0, 1, (0, 2), "uint16"), b""),
        encode(HeaderMeta("numpy/ndarray", 5.0, 1, (1 << 60, 1 << 60), "uint16"), b""),
        encode(HeaderMeta("numpy/ndarray", float("nan"), 1, (1, 1), "uint16"), b"xx"),
        encode(HeaderMeta("application/octet-stream", 5.0, 1, (1, 1), "uint16"), b"xx"),
        encode(HeaderMeta("numpy/ndarray", 5.0), b"xx"),
    ],
)
def test_an_image_whose_header_does_not_account_for_it_is_refused(sample):
    with pytest.raises(WireError):
        decode_depth(sample)


@pytest.mark.parametrize(
    "sample", [array([1.0, 2.0, 3.0]), array([[1, 2, 3]], "uint16"), array([[1.0, 2.0]], "float32")]
)
def test_points_of_another_shape_are_refused(sample):
    with pytest.raises(WireError):
        decode_pointcloud(sample)


def test_a_report_whose_bytes_are_not_its_size_never_reaches_the_bus():
    with pytest.raises(WireError, match=r"\[2, 2\] of uint16 are 8 bytes, not 7"):
        encode_depth(DepthReport(5.0, b"1234567", 2, 2, "uint16"), 0)
    with pytest.raises(WireError, match="not whole points"):
        encode_pointcloud(PointCloudReport(5.0, b"1234", 3), 0)
