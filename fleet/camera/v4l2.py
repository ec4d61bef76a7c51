"""JPEG frames of a V4L2 device (Linux, 64 bit), with the ioctls of linux/videodev2.h."""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import mmap
import os
import select
import struct
from collections.abc import Generator

CAPTURE, MMAP, MJPEG = 1, 1, int.from_bytes(b"MJPG", "little")
S_FMT, REQBUFS, QUERYBUF, QBUF, DQBUF = 0xC0D05605, 0xC0145608, 0xC0585609, 0xC058560F, 0xC0585611
STREAMON, STREAMOFF = 0x40045612, 0x40045613
FORMAT_SIZE, BUFFER_SIZE = 208, 88
WIDTH, HEIGHT = 1280, 720
WARM_UP = 3  # frames until the automatic exposure has settled

_USED, _PLACE, _LENGTH = 8, 64, 72  # offsets in struct v4l2_buffer


def capture(path: str, timeout: float) -> bytes:
    """Return one frame; blocks for up to ``timeout`` s per frame. Raises OSError, also for another format."""
    with contextlib.closing(frames(path, timeout)) as coming:
        return next(itertools.islice(coming, WARM_UP - 1, None))


def frames(path: str, timeout: float) -> Generator[bytes]:
    """Yield frames until closed; the device is open meanwhile. Blocks and raises like ``capture``."""
    device = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    try:
        _set_format(device)
        fcntl.ioctl(device, REQBUFS, bytearray(struct.pack("=5I", 1, CAPTURE, MMAP, 0, 0)))
        place = _buffer()
        fcntl.ioctl(device, QUERYBUF, place)
        offset, length = _number(place, _PLACE), _number(place, _LENGTH)
        with mmap.mmap(device, length, offset=offset) as memory:
            yield from _stream(device, memory, timeout)
    finally:
        os.close(device)


def _set_format(device: int) -> None:
    """Request JPEG; the device may choose another size, but not another format. Raises OSError."""
    wanted = bytearray(FORMAT_SIZE)
    struct.pack_into("=I4x4I", wanted, 0, CAPTURE, WIDTH, HEIGHT, MJPEG, 1)
    fcntl.ioctl(device, S_FMT, wanted)
    if _number(wanted, 16) != MJPEG:
        raise OSError("the camera gives no JPEG; use a snapshot URL or a file")


def _stream(device: int, memory: mmap.mmap, timeout: float) -> Generator[bytes]:
    """Yield frames; the device fills the buffer again while the last frame, a copy, is in use."""
    fcntl.ioctl(device, QBUF, _buffer())
    fcntl.ioctl(device, STREAMON, struct.pack("=i", CAPTURE))
    try:
        while True:
            _wait(device, timeout)
            taken = _buffer()
            fcntl.ioctl(device, DQBUF, taken)
            frame = memory[: _number(taken, _USED)]
            fcntl.ioctl(device, QBUF, _buffer())
            yield frame
    finally:
        fcntl.ioctl(device, STREAMOFF, struct.pack("=i", CAPTURE))


def _wait(device: int, timeout: float) -> None:
    """Wait for a frame."""
    if not select.select([device], [], [], timeout)[0]:
        raise OSError(f"the camera gave no picture within {timeout:g} s")


def _buffer() -> bytearray:
    """Return an empty struct v4l2_buffer for the only buffer."""
    empty = bytearray(BUFFER_SIZE)
    struct.pack_into("=2I", empty, 0, 0, CAPTURE)
    struct.pack_into("=I", empty, 60, MMAP)
    return empty


def _number(values: bytearray, offset: int) -> int:
    """Return a 32-bit number of a struct."""
    found: int = struct.unpack_from("=I", values, offset)[0]
    return found
