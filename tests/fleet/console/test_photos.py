"""Pictures of robots: the newest of a few robots, and only what is a JPEG picture."""

import pytest

from fleet.console import photos as module
from fleet.console.photos import MOST, Photos
from fleet.model.report import PhotoReport
from fleet.wire.databus import encode_report

JPEG = b"\xff\xd8\xff"


@pytest.fixture
def photos():
    return Photos()


def photo(stamp=1.0, image=JPEG):
    return encode_report(PhotoReport(stamp, image, "jpeg", 4, 3), 1)


def test_the_newest_picture_is_kept_whatever_comes_last(photos):
    assert photos.store("yard/rex", photo(2.0, JPEG + b"2")) == {"stamp": 2.0, "width": 4, "height": 3}
    assert photos.store("yard/rex", photo(1.0, JPEG + b"1")) is None
    assert photos.newest("yard/rex") == JPEG + b"2"
    assert photos.newest("yard/max") is None


@pytest.mark.parametrize(
    "sample",
    [b"", b"garbage", photo(image=b"<svg onload=alert(1)>"), photo(image=b"\x89PNG\r\n"), photo(image=b"")],
)
def test_what_is_no_picture_is_left_out(photos, sample):
    assert photos.store("yard/rex", sample) is None
    assert photos.newest("yard/rex") is None


def test_pictures_are_bounded_in_size_and_number(photos, monkeypatch):
    for number in range(MOST + 1):
        photos.store(f"yard/{number}", photo())
    assert photos.newest("yard/0") is None
    assert photos.newest(f"yard/{MOST}") == JPEG
    monkeypatch.setattr(module, "LARGEST", 10)
    assert photos.store("yard/rex", photo(image=JPEG + bytes(8))) is None
