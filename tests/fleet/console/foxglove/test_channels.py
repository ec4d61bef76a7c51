"""Channels made from what is on the buses, as a recorder would write them."""

import json

import jsonschema
import msgspec
import pytest

from fleet.console.foxglove import channels as module
from fleet.console.foxglove.channels import Channels
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import BatteryReport, PoseReport
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.record.schemas import schema_of
from fleet.wire.databus import encode_report

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
KEY = f"cw/{TWIN}/data/position"
STATE = (
    "fleet/yard-1/robots/rex/state",
    msgspec.json.encode(RobotState("rex", TWIN, "toy", "yard-1", 5.0, placement=Placement())),
)
S = 1_000_000_000


def pose(x):
    return encode_report(PoseReport(1.0, Vector3(x, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0)), 1)


@pytest.fixture
def channels():
    channels = Channels()
    channels.convert("yard-1", [STATE], 0, frozenset())
    return channels


def test_topics_and_schemas_are_those_of_recordings(channels):
    found = channels.convert("yard-1", [(KEY, pose(2.0))], S, frozenset())
    assert {(each.topic, each.schema) for each in channels.all} == {
        ("/yard-1/rex/state", "fleet.RobotState"),
        ("/yard-1/rex/world_transform", "foxglove.FrameTransform"),
        ("/yard-1/rex/position", "foxglove.PoseInFrame"),
        ("/yard-1/rex/transform", "foxglove.FrameTransform"),
    }
    assert [each.number for each in channels.all] == [1, 2, 3, 4]
    for sample in found:
        schema = channels.all[sample.channel - 1].schema
        jsonschema.validate(json.loads(sample.payload), json.loads(schema_of(schema)))
        assert (sample.received, channels.newest[sample.channel]) == (S, sample)


def test_reports_that_nobody_wants_are_read_once_a_second(channels):
    def taken(at, wanted=frozenset()):
        return len(channels.convert("yard-1", [(KEY, pose(at))], round(at * S), wanted))

    assert [taken(1.0), taken(1.5), taken(1.9), taken(2.0)] == [2, 0, 0, 2]
    assert taken(2.1, frozenset({3})) == 2


def test_a_robot_of_another_edge_is_shown_by_the_bus_of_its_own_alone(channels):
    assert channels.convert("yard-2", [(KEY, pose(1.0))], S, frozenset()) == []
    assert len(channels.convert("yard-1", [(KEY, pose(1.0))], S, frozenset())) == 2


def test_an_empty_sample_tells_nothing(channels):
    assert channels.convert("yard-1", [(KEY, b"")], S, frozenset()) == []


def test_more_topics_than_are_shown_are_reported_once(channels, monkeypatch, caplog):
    monkeypatch.setattr(module, "MOST", 2)
    battery = f"cw/{TWIN}/data/battery", encode_report(BatteryReport(1.0, 50.0), 1)
    for at in (1, 3):
        assert channels.convert("yard-1", [battery], at * S, frozenset()) == []
    assert [record.getMessage() for record in caplog.records] == [
        "Foxglove is shown 2 topics at most; /yard-1/rex/battery and later ones are left out"
    ]
