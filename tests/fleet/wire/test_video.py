import json

import pytest

from fleet.errors import WireError
from fleet.model.command import Command
from fleet.wire.video import VideoReply, read_video_reply, read_video_request, video_request


def request(**data):
    return read_video_request(video_request(Command("start_video", data)))


def test_what_is_asked_is_recorded_unless_it_says_otherwise():
    assert request().recording
    assert not request(recording=False).recording


@pytest.mark.parametrize("field", ["sensor", "sensor_id"])
def test_a_request_is_for_the_sensor_that_it_names_or_for_all(field):
    assert request().is_for("front")
    assert request(**{field: "front"}).is_for("front")
    assert not request(**{field: "rear"}).is_for("front")


@pytest.mark.parametrize(
    "payload", [b"", b"{", b"[]", b'{"command": "arm"}', b'{"command": "start_video", "data": 1}']
)
def test_what_is_no_request_is_refused(payload):
    with pytest.raises(WireError):
        read_video_request(payload)


def test_a_programs_answer_says_whether_and_why_not():
    assert read_video_reply(json.dumps({"ok": False, "reason": "busy"}).encode()) == VideoReply(False, "busy")
    for payload in (b"", b"{}", b'{"ok": 1}'):
        with pytest.raises(WireError):
            read_video_reply(payload)
