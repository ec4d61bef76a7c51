"""Frames of a V4L2 device: what the kernel is asked, in the layout of its structs."""

import struct

import pytest

from fleet.camera import v4l2
from fleet.camera.v4l2 import capture, frames
from tests.fleet.camera.pictures import JPEG

KERNEL = struct.Struct("=3I")  # the first words of each struct


@pytest.fixture
def asked(device, monkeypatch):
    """Record each call with its argument; ``ready`` says whether a frame comes in time."""
    path, _ = device
    answer, seen, waits = v4l2.fcntl.ioctl, [], []

    def ioctl(descriptor, call, argument):
        seen.append((call, bytes(argument)))
        answer(descriptor, call, argument)

    def select(readers, _writers, _failed, timeout):
        waits.append(timeout)
        return (readers, [], []) if asked.ready else ([], [], [])

    class asked:  # noqa: N801 - a name space
        ready = True
        calls, timeouts, name = seen, waits, str(path)

    monkeypatch.setattr("fleet.camera.v4l2.fcntl.ioctl", ioctl)
    monkeypatch.setattr("fleet.camera.v4l2.select.select", select)
    return asked


def test_the_numbers_of_the_calls_are_those_of_linux():
    """_IOWR('V', number, struct of this size) of linux/videodev2.h, on 64 bit."""

    def call(direction, number, size):
        return direction << 30 | size << 16 | ord("V") << 8 | number

    both, write = 3, 1
    assert call(both, 5, v4l2.FORMAT_SIZE) == v4l2.S_FMT
    assert call(both, 8, 20) == v4l2.REQBUFS
    buffers = {9: v4l2.QUERYBUF, 15: v4l2.QBUF, 17: v4l2.DQBUF}
    assert all(call(both, number, v4l2.BUFFER_SIZE) == found for number, found in buffers.items())
    assert (call(write, 18, 4), call(write, 19, 4)) == (v4l2.STREAMON, v4l2.STREAMOFF)


def test_a_capture_asks_for_jpeg_of_one_buffer_and_ends_the_stream(asked):
    assert capture(asked.name, 2.0) == JPEG
    numbers = [call for call, _ in asked.calls]
    start = [v4l2.S_FMT, v4l2.REQBUFS, v4l2.QUERYBUF, v4l2.QBUF, v4l2.STREAMON]
    assert numbers == [*start, *[v4l2.DQBUF, v4l2.QBUF] * v4l2.WARM_UP, v4l2.STREAMOFF]
    arguments = dict(asked.calls)
    kind, *_ = struct.unpack_from("=I", arguments[v4l2.S_FMT])
    assert (kind, struct.unpack_from("=3I", arguments[v4l2.S_FMT], 8)) == (1, (1280, 720, v4l2.MJPEG))
    assert KERNEL.unpack_from(arguments[v4l2.REQBUFS]) == (1, v4l2.CAPTURE, v4l2.MMAP)
    for call in (v4l2.QUERYBUF, v4l2.QBUF, v4l2.DQBUF):
        assert len(arguments[call]) == v4l2.BUFFER_SIZE
        assert struct.unpack_from("=2I", arguments[call]) == (0, v4l2.CAPTURE)
        assert struct.unpack_from("=I", arguments[call], 60) == (v4l2.MMAP,)
    assert arguments[v4l2.STREAMON] == arguments[v4l2.STREAMOFF] == struct.pack("=i", v4l2.CAPTURE)


def test_each_frame_has_its_own_time_to_come(asked):
    capture(asked.name, 2.5)
    assert asked.timeouts == [2.5] * v4l2.WARM_UP


def test_a_frame_that_does_not_come_in_time_ends_the_stream(asked):
    asked.ready = False
    with pytest.raises(OSError, match=r"the camera gave no picture within 2\.5 s"):
        capture(asked.name, 2.5)
    assert asked.calls[-1][0] == v4l2.STREAMOFF


def test_frames_come_until_they_are_closed_and_a_frame_is_a_copy(asked):
    coming = frames(asked.name, 1.0)
    first, second = next(coming), next(coming)
    assert (first, type(first), second) == (JPEG, bytes, JPEG)
    assert asked.calls[-1][0] == v4l2.QBUF
    coming.close()
    assert asked.calls[-1][0] == v4l2.STREAMOFF


def test_a_device_that_chose_another_format_is_refused_and_closed(device, monkeypatch):
    path, _ = device
    closed = []

    def other_format(_descriptor, _call, argument):
        argument[16:20] = b"YUYV"

    real = v4l2.os.close
    monkeypatch.setattr("fleet.camera.v4l2.fcntl.ioctl", other_format)
    monkeypatch.setattr("fleet.camera.v4l2.os.close", lambda descriptor: closed.append(real(descriptor)))
    with pytest.raises(OSError, match="the camera gives no JPEG; use a snapshot URL or a file"):
        capture(str(path), 1.0)
    assert closed == [None]


def test_a_device_that_is_not_there_is_an_error_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError):
        capture(str(tmp_path / "none"), 1.0)
