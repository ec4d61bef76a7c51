"""What a recording has of one robot: the frames of its links in order, and its reports by channel."""

import json

import msgspec
import pytest

from fleet.link.tap import LinkFrame, LinkFrames
from fleet.record.reading import ReadMessage
from fleet.replay.recorded_robot import FRAMES, RecordedReport, RecordedRobot, recording_of, said_in


def frame(at, direction="in", data=b"x"):
    return LinkFrame(at, direction, data)


def frames(robot, link, *found, edge="yard"):
    """Return a recorded message with frames of a link."""
    data = msgspec.json.encode(LinkFrames(1.0, robot, link, list(found)))
    return ReadMessage(f"/{edge}/{robot}/frames" if robot else f"/{edge}/frames", FRAMES, 1.0, 1.0, data)


def report(topic, document, *, schema="fleet.Battery", stamp=5.0):
    return ReadMessage(topic, schema, stamp, stamp, json.dumps(document).encode())


def test_the_frames_of_all_its_links_are_in_the_order_of_time():
    recording = recording_of(
        [
            frames("rex", "tcp:1", frame(1.0), frame(4.0)),
            frames("rex", "udp:2", frame(2.0), frame(3.0)),
            frames("rex", "tcp:1", frame(5.0)),
        ]
    )
    robot = recording.robot("yard", "rex")
    assert [(link, each.at) for link, each in robot.frames] == [
        ("tcp:1", 1.0),
        ("udp:2", 2.0),
        ("udp:2", 3.0),
        ("tcp:1", 4.0),
        ("tcp:1", 5.0),
    ]
    assert robot.links == ("tcp:1", "udp:2")


def test_frames_of_one_instant_stay_in_their_order():
    first, second = frame(1.0, data=b"one"), frame(1.0, data=b"two")
    robot = recording_of([frames("rex", "tcp:1", first, second)]).robot("yard", "rex")
    assert [each.data for _, each in robot.frames] == [b"one", b"two"]


def test_links_of_other_robots_and_edges_are_not_its_own():
    recording = recording_of(
        [
            frames("rex", "tcp:1", frame(1.0)),
            frames("ada", "tcp:2", frame(2.0)),
            frames("rex", "tcp:1", frame(3.0), edge="barn"),
        ]
    )
    assert recording.robots == [("barn", "rex"), ("yard", "ada"), ("yard", "rex")]
    assert [each.at for _, each in recording.robot("yard", "rex").frames] == [1.0]
    assert recording.robot("yard", "max").frames == ()


def test_a_link_that_another_opened_for_it_may_be_added():
    recording = recording_of([frames("", "can0", frame(1.0)), frames("rex", "tcp:1", frame(2.0))])
    assert recording.robots == [("yard", "rex")], "the host is no robot"
    assert recording.robot("yard", "rex", ["can0"]).links == ("can0", "tcp:1")


@pytest.mark.parametrize(
    ("found", "whole"),
    [
        ([("a", "open"), ("a", "in"), ("b", "open")], True),
        ([("a", "open"), ("b", "in"), ("b", "open")], False),
        ([("a", "in"), ("a", "open")], False),
        ([("a", "open"), ("a", "in"), ("a", "open")], True),
        ([], False),
    ],
)
def test_it_is_whole_if_every_link_is_there_from_its_opening(found, whole):
    pairs = tuple((link, frame(at, direction)) for at, (link, direction) in enumerate(found))
    assert RecordedRobot("yard", "rex", pairs, {}).is_whole is whole


def test_a_report_is_what_it_says_without_its_stamps():
    said = said_in("battery", b'{"timestamp": 1, "stamp": 2, "percent": 80.5}', 5.0)
    assert said == ("battery", RecordedReport(5.0, {"percent": 80.5}))


@pytest.mark.parametrize(
    ("kind", "channel"), [("vehicle_state", "telemetry:vehicle_state"), (7, "telemetry")]
)
def test_a_channel_with_several_kinds_of_messages_is_split_by_kind(kind, channel):
    name, said = said_in("telemetry", json.dumps({"type": kind}).encode(), 5.0)
    assert (name, said.content) == (channel, {"type": kind})


def test_the_reports_of_a_robot_are_gathered_by_channel_in_order():
    recording = recording_of(
        [
            report("/yard/rex/battery", {"percent": 80}, stamp=1.0),
            report("/yard/rex/state/pose", {"x": 1}, stamp=2.0),
            report("/yard/rex/battery", {"percent": 79}, stamp=3.0),
            report("/yard/ada/battery", {"percent": 20}),
        ]
    )
    reports = recording.robot("yard", "rex").reports
    assert [said.content["percent"] for said in reports["battery"]] == [80, 79]
    assert set(reports) == {"battery", "state/pose"}


@pytest.mark.parametrize(
    "schema", ["foxglove.FrameTransform", "fleet.RobotState", "fleet.RobotDescription", "fleet.Record"]
)
def test_what_the_host_says_of_a_robot_is_no_report_of_it(schema):
    assert recording_of([report("/yard/rex/state", {"name": "rex"}, schema=schema)]).reports == {}


@pytest.mark.parametrize("data", [b"", b"[]", b"no json"])
def test_a_damaged_message_is_an_error(data):
    with pytest.raises(ValueError, match=r"."):
        recording_of([ReadMessage("/yard/rex/battery", "fleet.Battery", 1.0, 1.0, data)])
