"""What a robot of a run is told: in the formats of any sender, in the name of who started the run."""

import json

import pytest

from fleet.errors import Refused
from fleet.missions.messages import message_of, payload_of
from fleet.missions.plan import MADE_FOR
from fleet.missions.points import SiteMap
from fleet.missions.program import Act
from fleet.model.geometry import Vector3
from fleet.model.place import Place
from fleet.model.site import Placement
from fleet.model.state import RobotState
from fleet.wire.missions import EXECUTION

HERE = Vector3(0.0, 0.0, 0.0)
ROBOT = RobotState("rex", "t", "toy", "yard", 0.0, site=HERE, placement=Placement(HERE, 0.0))
SITE = SiteMap({"gate": Place("gate", (4.0, 5.0))})
ID = "3f2a/go.1/rex/1"


def told(*act, **options):
    return message_of(Act(*act, **options), ID, ROBOT, SITE)


def test_a_command_is_sent_with_its_data():
    assert told("command", "takeoff", {"altitude": 5}) == (
        "command",
        {"command": "takeoff", "data": {"altitude": 5}},
    )


def test_a_place_is_sent_as_a_position_with_the_identity_of_the_part():
    assert told("goto", "gate") == (
        "navigate",
        {"command": "goto", "action_id": ID, "position": [4.0, 5.0]},
    )


def test_a_path_is_sent_point_by_point():
    _, message = told("path", [[1, 2], "gate"])
    assert message == {
        "command": "path",
        "action_id": ID,
        "waypoints": [{"position": [1.0, 2.0]}, {"position": [4.0, 5.0]}],
    }


def test_who_follows_is_told_whom_and_how_far_behind():
    _, message = told("follow", "ada", {"distance_m": 4.0})
    assert message == {"command": "follow", "action_id": ID, "robot": "ada", "distance_m": 4.0}


@pytest.mark.parametrize(("verb", "value"), [("goto", [1, 2]), ("path", [[1, 2]]), ("follow", "ada")])
@pytest.mark.parametrize(("speed", "constraints"), [(None, None), (1.5, {"max_speed_ms": 1.5})])
def test_a_speed_is_a_limit_in_metres_a_second(verb, value, speed, constraints):
    kind, message = told(verb, value, speed=speed)
    assert (kind, message.get("constraints")) == ("navigate", constraints)


def test_a_plan_is_sent_as_items_without_what_it_was_made_for():
    kind, message = told("plan", {"items": [], MADE_FOR: ["px4"]})
    assert (kind, message) == ("mission", {"command": "start", EXECUTION: ID, "mission": {"items": []}})


def test_a_place_that_is_gone_is_refused():
    with pytest.raises(Refused, match="there is no place 'dock'"):
        told("goto", "dock")


@pytest.mark.parametrize("source", [None, "tele", ""])
def test_a_message_has_the_sender_and_the_time_and_a_source_type_where_there_is_one(source):
    payload = payload_of({"command": "land"}, session="anna", source_type=source, now=1000.5)
    more = {} if source is None else {"source_type": source}
    assert json.loads(payload) == {"command": "land", "session_id": "anna", "timestamp": 1000.5} | more


def test_nobody_can_give_another_sender_in_the_data_of_a_message():
    payload = payload_of({"session_id": "eve", "timestamp": 1.0}, session="anna", source_type=None, now=2.0)
    assert json.loads(payload) == {"session_id": "anna", "timestamp": 2.0}
