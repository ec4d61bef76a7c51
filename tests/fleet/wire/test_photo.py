import base64
import json

from fleet.model.report import PhotoReport
from fleet.wire.reports import sender, to_mqtt
from fleet.wire.rules import rule_of

PHOTO = PhotoReport(1760000000.5, b"\xff\xd8\xff\x00picture", "jpeg", 640, 480)


def test_a_photo_goes_to_its_own_topic_in_base64():
    [(suffix, payload)] = to_mqtt(PHOTO, sender(source_type="edge", session="s"))
    said = json.loads(payload)
    assert suffix == "camera/photo"
    assert base64.b64decode(said.pop("image")) == PHOTO.image
    assert said == {
        "format": "jpeg",
        "width": 640,
        "height": 480,
        "source_type": "edge",
        "timestamp": PHOTO.stamp,
        "session_id": "s",
    }


def test_a_photo_is_sent_once_and_never_repeated():
    rule = rule_of("camera/photo")
    assert (rule.repeat, rule.max_rate, rule.qos) == (0, 0, 0)
