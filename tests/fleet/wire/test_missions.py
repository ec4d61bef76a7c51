import json

import pytest

from fleet.model.command import Reply, ReplyStatus, Way
from fleet.model.navigation import Control
from fleet.wire.envelope import BadCommand
from fleet.wire.missions import decode_mission, mission_status


def decode(**message):
    return decode_mission(json.dumps(message).encode(), way=Way.CLOUD)


def test_a_cancelled_mission_stops_the_robot_whatever_else_is_wrong_with_it():
    ask = decode(command="cancel", timestamp="never", source_type=5)
    assert (ask.ask, ask.stamp, ask.origin.source_type) == (Control.STOP, None, None)


@pytest.mark.parametrize("command", ["start", "pause", "resume", "anything"])
def test_anything_else_is_refused_with_what_to_do_instead(command):
    with pytest.raises(
        BadCommand, match="flies no missions; send the goals as a path on navigate/command"
    ) as bad:
        decode(command=command, steps=[])
    assert bad.value.command == command


@pytest.mark.parametrize("payload", [b"", b"[]", b'{"command": 5}', b"\xff", b'{"a": NaN}'])
def test_what_cannot_be_read_is_refused_as_a_mission(payload):
    with pytest.raises(BadCommand) as bad:
        decode_mission(payload, way=Way.CLOUD)
    assert bad.value.command == "mission"


def test_the_status_names_the_mission_and_the_reason():
    reply = Reply("start", ReplyStatus.REJECTED, "no missions")
    status = mission_status(b'{"mission_execution_uuid": "m1"}', reply, source_type="edge", stamp=5.0)
    assert json.loads(status) == {
        "mission_execution_uuid": "m1",
        "status": "failed",
        "current_step": 0,
        "message": "no missions",
        "source_type": "edge",
        "timestamp": 5.0,
    }
    cancelled = mission_status(
        b'{"mission_execution_uuid": "m1"}', Reply("stop", ReplyStatus.ACCEPTED), source_type="sim", stamp=5.0
    )
    assert json.loads(cancelled)["status"] == "cancelled"


@pytest.mark.parametrize(
    "payload", [b"{}", b"", b'{"mission_execution_uuid": 5}', b'{"mission_execution_uuid": ""}']
)
def test_a_mission_without_a_name_gets_no_status(payload):
    reply = Reply("start", ReplyStatus.REJECTED, "no")
    assert mission_status(payload, reply, source_type="edge", stamp=5.0) is None
