import json

import pytest

from fleet.model.command import Reply, ReplyStatus

PLAN = {"contract": "aerial.mission.v1", "name": "field", "items": [{"type": "return_to_launch"}]}
TAKEN = Reply("start", ReplyStatus.ACCEPTED)
DONE = Reply("start", ReplyStatus.ACCEPTED, done=True)


@pytest.fixture
def kestrel(play_edge):
    """Play an edge with one robot, which is at the second item of a mission."""
    doing = "mission, item 2 of 3, 33 %"
    robots = {
        "kestrel": {"health": "ok", "activity": doing, "last_command": "takeoff", "last_outcome": "done"}
    }
    return play_edge("yard-1", robots=robots)


@pytest.fixture
def plan(place):
    path = place / "field.json"
    path.write_text(json.dumps(PLAN))
    return str(path)


def test_a_mission_file_is_given_to_the_robot(fleet, kestrel, plan):
    asked = kestrel.answers("kestrel", TAKEN)
    result = fleet("mission", "kestrel", "start", plan)
    assert (result.code, result.out) == (0, "kestrel: start accepted\n")
    message = json.loads(asked[0].payload)
    assert (message["command"], message["mission"]) == ("start", PLAN)
    assert message["mission_execution_uuid"]
    assert asked[0].parameters == {"kind": "mission", "wait": "0"}


def test_a_mission_that_is_waited_for_is_followed_by_item(fleet, kestrel, plan, monkeypatch):
    monkeypatch.setattr("fleet.cli.mission._LOOK", 0.01)
    kestrel.answers_late("kestrel", TAKEN, DONE)
    result = fleet("mission", "kestrel", "start", plan, "--wait")
    assert (result.code, result.out.splitlines()[-1]) == (0, "kestrel: start done")
    assert result.err == "kestrel: mission, item 2 of 3, 33 %\n"


def test_what_is_no_json_is_refused_before_the_robot_hears_of_it(fleet, kestrel, place):
    asked = kestrel.answers("kestrel", TAKEN)
    (place / "field.json").write_text("{")
    result = fleet("mission", "kestrel", "start", "field.json")
    assert result.code == 5
    assert result.err.startswith("fleet: field.json is no JSON: ")
    assert asked == []


@pytest.mark.parametrize("name", ["pause", "resume", "cancel"])
def test_a_control_is_sent_and_its_end_waited_for(fleet, kestrel, name):
    asked = kestrel.answers(
        "kestrel", Reply(name, ReplyStatus.ACCEPTED), Reply(name, ReplyStatus.ACCEPTED, done=True)
    )
    result = fleet("mission", "kestrel", name)
    assert (result.code, result.out.splitlines()[-1]) == (0, f"kestrel: {name} done")
    assert asked[0].parameters == {"kind": "mission", "wait": "1"}
    assert json.loads(asked[0].payload)["command"] == name


def test_clearing_is_a_command(fleet, kestrel):
    asked = kestrel.answers("kestrel", Reply("clear_mission", ReplyStatus.DENIED, "it is flown"))
    assert fleet("mission", "kestrel", "clear").code == 5
    assert json.loads(asked[0].payload)["command"] == "clear_mission"
    assert asked[0].parameters["kind"] == "command"


def test_how_far_it_is_is_shown(fleet, kestrel):
    result = fleet("mission", "kestrel", "status")
    assert (result.code, result.out) == (
        0,
        "kestrel: mission, item 2 of 3, 33 %\nkestrel: last command takeoff: done\n",
    )
    said = fleet("mission", "kestrel", "status", "--json").json
    assert said["doing"] == "mission, item 2 of 3, 33 %"
