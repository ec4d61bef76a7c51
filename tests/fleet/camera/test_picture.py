import http.server
import threading

import pytest

from fleet import Refused, Unsupported
from fleet.camera import v4l2
from fleet.camera.camera import Camera
from fleet.camera.picture import jpeg_size, photograph, take_picture
from fleet.testing.clock import ManualClock

JPEG = (
    bytes.fromhex("ffd8 ffe0 0004 0000 ffc0 0011 08 01e0 0280 03 011100021100031100 ffda".replace(" ", ""))
    + b"data"
)


@pytest.fixture
def snapshot():
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200 if self.path == "/shot" else 404)
            self.end_headers()
            self.wfile.write(JPEG)

        def log_message(self, *args):
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def test_a_pictures_size_is_read_from_it():
    assert jpeg_size(JPEG) == (640, 480)


@pytest.mark.parametrize("data", [b"", b"GIF89a", JPEG[:12], b"\xff\xd8\xff\xda", b"\xff\xd8" + b"\xff" * 40])
def test_what_is_no_picture_is_refused(data):
    with pytest.raises(Refused, match="JPEG"):
        jpeg_size(data)


async def test_a_picture_comes_from_a_file(tmp_path):
    (tmp_path / "shot.jpg").write_bytes(JPEG)
    picture = await take_picture(f"file:{tmp_path}/shot.jpg")
    assert (picture.data, picture.width, picture.height) == (JPEG, 640, 480)


async def test_a_file_that_is_not_there_is_refused_with_the_reason(tmp_path):
    with pytest.raises(Refused, match="No such file"):
        await take_picture(f"file:{tmp_path}/none.jpg")


async def test_a_picture_comes_from_a_snapshot_url(snapshot):
    assert (await take_picture(f"{snapshot}/shot")).data == JPEG


async def test_a_camera_that_refuses_is_reported(snapshot):
    with pytest.raises(Refused, match="404"):
        await take_picture(f"{snapshot}/other")


async def test_a_picture_that_is_too_large_is_refused(tmp_path):
    (tmp_path / "huge.jpg").write_bytes(JPEG + bytes(5 * 1024 * 1024))
    with pytest.raises(Refused, match="larger"):
        await take_picture(f"file:{tmp_path}/huge.jpg")


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


async def test_a_picture_comes_from_a_video_device_after_its_warm_up(device):
    path, calls = device
    assert (await take_picture(f"v4l2:{path}")).data == JPEG
    assert calls.count(v4l2.DQBUF) == v4l2.WARM_UP
    assert calls[-1] == v4l2.STREAMOFF


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


async def test_a_video_device_that_has_no_jpeg_is_refused(device, monkeypatch):
    def other_format(_descriptor, _call, argument):
        argument[16:20] = b"YUYV"

    monkeypatch.setattr("fleet.camera.v4l2.fcntl.ioctl", other_format)
    with pytest.raises(Refused, match="gives no JPEG"):
        await take_picture(f"v4l2:{device[0]}")


async def test_a_photo_has_its_size_and_needs_a_camera(tmp_path):
    (tmp_path / "shot.jpg").write_bytes(JPEG)
    photo = await photograph(f"file:{tmp_path}/shot.jpg", ManualClock())
    assert (photo.image, photo.width, photo.height) == (JPEG, 640, 480)
    with pytest.raises(Unsupported, match="no camera is configured"):
        await photograph(None, ManualClock())
