"""A V4L2 device that is a file."""

import pytest

from fleet.camera import v4l2
from tests.fleet.camera.pictures import JPEG


@pytest.fixture
def device(tmp_path, monkeypatch):
    """Fake a V4L2 device: a file as its memory, and calls that answer as the kernel does."""
    path = tmp_path / "video0"
    path.write_bytes(JPEG.ljust(4096, b"\0"))
    calls = []

    def ioctl(_descriptor, call, argument):
        calls.append(call)
        if call == v4l2.QUERYBUF:
            argument[72:76] = (4096).to_bytes(4, "little")
        if call == v4l2.DQBUF:
            argument[8:12] = len(JPEG).to_bytes(4, "little")

    monkeypatch.setattr("fleet.camera.v4l2.fcntl.ioctl", ioctl)
    return path, calls
