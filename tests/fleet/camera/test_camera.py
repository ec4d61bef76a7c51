"""A camera that is kept open for a sequence of pictures."""

import threading

import pytest

from fleet import Refused
from fleet.camera import camera as cameras
from fleet.camera import v4l2
from fleet.camera.camera import Camera
from tests.fleet.camera.pictures import JPEG


async def test_a_cameras_device_stays_open_from_its_first_picture_to_its_end(device):
    path, calls = device
    camera = Camera(f"v4l2:{path}")
    assert [(await camera.picture()).data for _ in range(4)] == [JPEG] * 4
    assert (calls.count(v4l2.STREAMON), calls.count(v4l2.DQBUF)) == (1, 4)
    await camera.close()
    assert calls[-1] == v4l2.STREAMOFF


async def test_a_cameras_device_that_failed_is_opened_anew(device):
    path, _ = device
    camera = Camera(f"v4l2:{path}")
    content = path.read_bytes()
    path.unlink()
    with pytest.raises(Refused, match="No such file"):
        await camera.picture()
    path.write_bytes(content)
    assert (await camera.picture()).data == JPEG
    await camera.close()


async def test_a_camera_that_is_a_file_shows_what_is_in_it_now(tmp_path):
    path = tmp_path / "shot.jpg"
    camera = Camera(f"file:{path}")
    for more in (b"1", b"2"):
        path.write_bytes(JPEG + more)
        assert (await camera.picture()).data == JPEG + more
    await camera.close()


@pytest.mark.parametrize("error", [OSError("gone"), ValueError("cannot mmap an empty file")])
def test_a_device_that_failed_in_any_way_is_opened_anew(monkeypatch, error):
    """A generator that has raised is spent: it would only say that it has ended."""
    failures = [error]

    def frames(_path, _timeout):
        if failures:
            raise failures.pop()
        yield JPEG

    monkeypatch.setattr(cameras, "frames", frames)
    camera = Camera("v4l2:/dev/video0")
    with pytest.raises(type(error)):
        camera._next()
    assert camera._next() == JPEG


async def test_a_camera_that_was_never_used_can_be_closed_and_one_that_was_closed_opens_again(device):
    path, calls = device
    camera = Camera(f"v4l2:{path}")
    await camera.close()
    assert calls == []
    for opened in (1, 2):
        assert (await camera.picture()).data == JPEG
        await camera.close()
        assert calls.count(v4l2.STREAMON) == opened


async def test_a_device_is_closed_once_a_running_read_has_ended(monkeypatch):
    """The caller of a read may have given up before."""
    reading, go_on, ended = threading.Event(), threading.Event(), []

    def frames(path, timeout):
        try:
            while True:
                reading.set()
                go_on.wait(20)
                ended.append("read")
                yield JPEG
        finally:
            ended.append("closed")

    monkeypatch.setattr(cameras, "frames", frames)
    camera = Camera("v4l2:/dev/video0")
    thread = threading.Thread(target=camera._next)
    thread.start()
    assert reading.wait(20)
    closing = threading.Thread(target=camera._close)
    closing.start()
    go_on.set()
    thread.join()
    closing.join()
    assert ended == ["read", "closed"]


async def test_a_device_is_named_by_all_behind_its_scheme_and_has_seconds_for_a_frame(monkeypatch):
    asked = []

    def frames(path, timeout):
        asked.append((path, timeout))
        yield JPEG

    monkeypatch.setattr(cameras, "frames", frames)
    assert (await Camera("v4l2:/dev/v4l/by-id/usb:1").picture()).width == 640
    assert asked == [("/dev/v4l/by-id/usb:1", cameras.TIMEOUT)]
