"""A moment made of recorded messages: what cannot be read is left out, what is old is told as old."""

import msgspec
import pytest

from fleet.console.moment import moment
from fleet.model.state import EdgeState, RobotState
from fleet.record.reading import ReadMessage

AT = 1_795_000_000.0
REX = "yard-1/rex"


def recorded(topic, schema, value, *, ago=0.5):
    """Return a message that was recorded so many seconds before the moment."""
    data = value if isinstance(value, bytes) else msgspec.json.encode(value)
    return ReadMessage(f"/yard-1/{topic}", schema, AT - ago, AT - ago, data)


def state(ago=0.5, **fields):
    return recorded(
        "rex/state", "fleet.RobotState", RobotState("rex", "", "toy", "yard-1", AT - ago, **fields), ago=ago
    )


def edge(ago=0.5):
    return recorded("health", "fleet.EdgeState", EdgeState("yard-1", "1", AT - ago, 5.0), ago=ago)


def pose(x=1.0):
    half = {"orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}, "position": {"x": x, "y": 0.0, "z": 0.0}}
    return recorded(
        "rex/position", "foxglove.PoseInFrame", {"timestamp": {"sec": 1, "nsec": 0}, "pose": half}
    )


def places(ago=0.5):
    goals = {"robots": [{"robot": {"name": "rex", "way": [{"x": 3.0, "y": 4.0, "z": 0.0}]}}]}
    return recorded("places/main", "fleet.Document", goals, ago=ago)


def test_a_moment_has_the_entries_that_a_page_takes():
    found = moment(AT, [pose(), places(), state(health="ok"), edge()], [])
    entries = found["entries"]
    assert (found["at"], found["recorded"], found["events"]) == (AT, AT - 0.5, [])
    assert entries["poses"][REX] == [1.0, 0.0, 0.0, 0.0, False]
    assert entries["goals"][REX] == [[3.0, 4.0, 0.0]]
    assert entries["robots"][REX]["heard"] == AT - 0.5
    assert entries["edges"]["yard-1"]["alive"]


def test_an_edge_of_which_nothing_was_recorded_for_a_while_is_reported_as_away_and_its_goals_are_left_out():
    found = moment(AT, [state(ago=40.0), edge(ago=42.0), places(ago=40.0)], [])
    away = found["entries"]["edges"]["yard-1"]
    assert (away["alive"], away["problem"]) == (False, "nothing of it was recorded for 40 s")
    assert "goals" not in found["entries"]


def test_a_pose_of_a_robot_without_a_state_is_left_out():
    found = moment(AT, [pose(), edge()], [pose()])
    assert "poses" not in found["entries"]
    assert found["tracks"] == {}


@pytest.mark.parametrize(
    "broken",
    [
        recorded("rex/state", "fleet.RobotState", b"{}"),
        recorded("rex/position", "foxglove.PoseInFrame", b'{"pose": 5}'),
        recorded("runs", "fleet.RunState", b"[" * 5000),
        recorded("rex/history", "fleet.Record", b"\xff"),
        recorded("places/main", "fleet.Document", {"robots": 5}),
        recorded("rex/odd", "fleet.Odd", {}),
    ],
    ids=lambda message: message.schema,
)
def test_what_cannot_be_read_is_left_out_and_the_rest_is_reported(broken):
    found = moment(AT, [broken, state(), edge()], [broken])
    assert list(found["entries"]["robots"]) == [REX]
    assert (found["events"], found["tracks"]) == ([], {})
