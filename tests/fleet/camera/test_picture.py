import http.server
import threading

import pytest

from fleet import Refused, Unsupported
from fleet.camera import v4l2
from fleet.camera.picture import jpeg_size, photograph, take_picture
from fleet.testing.clock import ManualClock
from tests.fleet.camera.pictures import JPEG


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


async def test_a_picture_comes_from_a_video_device_after_its_warm_up(device):
    path, calls = device
    assert (await take_picture(f"v4l2:{path}")).data == JPEG
    assert calls.count(v4l2.DQBUF) == v4l2.WARM_UP
    assert calls[-1] == v4l2.STREAMOFF


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
