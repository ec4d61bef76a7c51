"""What arrives on the bus, under the names of edges and robots."""

import json

import jsonschema
import msgspec
import pytest

from fleet.history.record import Record
from fleet.missions.report import RunState
from fleet.model.body import BodyPart
from fleet.model.command import Transport
from fleet.model.description import CommandDescription, FenceDescription, RobotDescription
from fleet.model.event import EventKind, Requester
from fleet.model.report import BatteryReport
from fleet.model.schedule import ScheduleAnswer, ScheduleState
from fleet.model.site import Placement
from fleet.model.state import EdgeState, RobotState
from fleet.record.samples import SampleReader, event_message
from fleet.record.schemas import schema_of
from fleet.wire.databus import encode_report

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
STATE = RobotState("rex", TWIN, "toy", "yard-1", 5.0, placement=Placement(), site=None)
RUN = RunState("r1", "yard-1", "patrol", "running", "go", 1.0)
BATTERY = encode_report(BatteryReport(1.0, 50.0), 1)


@pytest.fixture
def reader():
    return SampleReader()


def recorded_as(reader, key, value):
    """Return topic and schema of what is recorded of a sample, each checked by its schema."""
    payload = value if isinstance(value, bytes) else msgspec.json.encode(value)
    messages = reader.read("yard-1", key, payload)
    for message in messages:
        jsonschema.validate(json.loads(message.payload), json.loads(schema_of(message.schema)))
    return [(message.topic, message.schema) for message in messages]


def test_reports_have_the_name_of_their_robot_once_its_state_was_reported(reader):
    key = f"cw/{TWIN}/data/battery"
    assert recorded_as(reader, key, BATTERY) == [(f"/twins/{TWIN}/battery", "fleet.BatteryReport")]
    assert recorded_as(reader, "fleet/yard-1/robots/rex/state", STATE) == [
        ("/yard-1/rex/state", "fleet.RobotState"),
        ("/yard-1/rex/world_transform", "foxglove.FrameTransform"),
    ]
    assert recorded_as(reader, key, BATTERY) == [("/yard-1/rex/battery", "fleet.BatteryReport")]


def test_a_robot_of_another_edge_is_recorded_by_the_bus_of_that_one(reader):
    recorded_as(reader, "fleet/yard-1/robots/rex/state", STATE)
    assert reader.read("yard-2", f"cw/{TWIN}/data/battery", BATTERY) == []


@pytest.mark.parametrize(
    ("key", "value", "topic", "schema"),
    [
        ("fleet/yard-1/health", EdgeState("yard-1", "1", 1.0, 2.0), "health", "fleet.EdgeState"),
        (
            "fleet/yard-1/runs/r1",
            RUN,
            "runs",
            "fleet.RunState",
        ),
        ("fleet/yard-1/places/main", {"robots": []}, "places/main", "fleet.Document"),
        ("fleet/*/stop", {"robots": []}, "stop", "fleet.Document"),
        ("fleet/yard-1/robots/rex/state", b"garbage", "robots/rex/state/unread", "fleet.Unread"),
        ("fleet/yard-1/health", b"[]", "health/unread", "fleet.Unread"),
    ],
)
def test_what_an_edge_publishes_is_recorded(reader, key, value, topic, schema):
    assert recorded_as(reader, key, value) == [(f"/yard-1/{topic}", schema)]


def test_a_command_is_recorded_with_who_asked():
    asker = Requester(Transport.BUS, "anna")
    event = Record(7.0, "rex", EventKind.COMMAND, "stop accepted", asker=asker, command="stop", request="c1")
    message = event_message("yard-1", event)
    body = json.loads(message.payload)
    jsonschema.validate(body, json.loads(schema_of(message.schema)))
    assert (message.topic, message.stamp) == ("/yard-1/rex/history", 7.0)
    assert (body["asker"]["name"], body["command"], body["request"]) == ("anna", "stop", "c1")
    assert event_message("yard-1", Record(7.0, "", EventKind.SCHEDULE, "x")).topic == "/yard-1/history"


def test_fence_and_body_of_a_robot_and_schedules_are_recorded_when_they_change(reader):
    def described(reach, refusal=""):
        fence = FenceDescription(inclusion=(((0.0, 0.0), (reach, 0.0), (reach, 1.0)),))
        commands = (CommandDescription("beep", refusal=refusal),)
        return RobotDescription("rex", "toy", commands, fence=fence, body=(BodyPart("trunk"),))

    def schedules(*, enabled):
        return ScheduleAnswer((ScheduleState("nightly", "round", "every 1 h", enabled),))

    description, listed = "fleet/yard-1/robots/*/description", "fleet/yard-1/schedules"
    expected = ("/yard-1/rex/description", "fleet.RobotDescription")
    assert recorded_as(reader, description, described(1.0)) == [expected]
    assert recorded_as(reader, description, described(1.0, "the battery is low")) == []
    assert recorded_as(reader, description, described(2.0)) == [expected]
    assert recorded_as(reader, listed, schedules(enabled=True)) == [
        ("/yard-1/schedules", "fleet.ScheduleAnswer")
    ]
    assert recorded_as(reader, listed, schedules(enabled=True)) == []
    standing = {each.topic: json.loads(each.payload) for each in reader.persistent_values}
    assert standing.keys() == {"/yard-1/rex/description", "/yard-1/schedules"}
    assert standing["/yard-1/rex/description"]["fence"]["inclusion"][0][1] == [2.0, 0.0]
    assert standing["/yard-1/rex/description"]["commands"] == []
