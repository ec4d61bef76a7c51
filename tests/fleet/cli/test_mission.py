import json
import threading

import msgspec
import pytest

from fleet.bus import keys
from fleet.cli.runs import robot_lines, state_line
from fleet.missions.report import Controlled, MissionState, PendingQuestion, RunRobot, RunState, Started
from fleet.missions.results import RunFile
from fleet.missions.store import RunLogEntry

MISSION = """
version: 1
roles: {eye: {}}
steps: [{id: up, do: {eye: takeoff}}]
"""
PLAN = {"contract": "aerial.mission.v1", "name": "field", "items": [{"type": "return_to_launch"}]}
PLAN["items"].insert(0, {"type": "waypoint", "latitude": 47.3, "longitude": 8.5, "altitude_m": 5})


def state(**fields):
    robots = (RunRobot("kestrel", "eye", "takeoff", lane=("arm done", "takeoff ...")),)
    return RunState("3f2a", "yard-1", "patrol", "step", "up.1", 1000.0, robots=robots, **fields)


class Missions:
    """Plays the part of an edge that knows missions and runs."""

    def __init__(self, edge):
        self.requested = []
        self.runs = [state()]
        self.started = Started("3f2a", {"eye": ["kestrel"]})
        self.refusal = ""
        self.story = [RunLogEntry(1000.0, "run begun")]
        self.results = []
        control = edge._control
        control.declare_queryable(keys.mission("yard-1", "*"), self._mission)
        control.declare_queryable(keys.run("yard-1", "*"), self._run)
        self.looked = threading.Event()

    def _mission(self, question):
        name = question.requested.rpartition("/")[2]
        if question.parameters.get("do") == "start":
            self.requested.append(json.loads(question.payload))
            question.reply(msgspec.json.encode(self.started), keys.mission("yard-1", name))
        elif name in ("*", "patrol"):
            known = MissionState("patrol", "yard-1", "round", {"height": "number m"}, {"eye": "1"}, ("up",))
            question.reply(msgspec.json.encode(known), keys.mission("yard-1", "patrol"))
        question.close()

    def _run(self, question):
        if question.payload:
            requested = json.loads(question.payload)
            self.requested.append(requested)
            said = {"log": self.story, "results": self.results}
            answer = said.get(requested["do"], Controlled(self.refusal))
            question.reply(msgspec.json.encode(answer), keys.run("yard-1", "3f2a"))
        else:
            for each in self.runs:
                question.reply(msgspec.json.encode(each), keys.run("yard-1", each.run))
        question.close()


@pytest.fixture
def yard(play_edge):
    return Missions(play_edge("yard-1", robots={"kestrel": {"health": "ok"}}))


@pytest.mark.parametrize(
    ("outcome", "code"),
    [("completed", 0), ("completed_with_losses", 7), ("failed", 8), ("aborted", 8), ("unknown", 9)],
)
def test_a_mission_is_started_and_followed_to_its_end(fleet, yard, outcome, code):
    yard.runs = [state(outcome=outcome)]
    result = fleet("mission", "run", "patrol", "height=7", "--json")
    assert (result.code, result.json["outcome"]) == (code, outcome)
    fill, start = yard.requested
    assert (fill["only_fill"], start.get("only_fill")) == (True, None)
    assert (start["inputs"], start["robots"]) == ({"height": 7}, {"eye": ["kestrel"]})
    assert "eye: kestrel" in result.err


def test_a_mission_that_is_refused_moves_nobody(fleet, yard):
    yard.started = Started(refusal="role eye needs 1, 0 can: kestrel: it is offline")
    result = fleet("mission", "run", "patrol")
    assert (result.code, len(yard.requested)) == (5, 1)
    assert "role eye needs 1" in result.err


def test_a_mission_file_is_checked_here_and_sent_whole(fleet, yard, place):
    (place / "patrol.yaml").write_text(MISSION)
    assert fleet("mission", "run", "patrol.yaml", "--robot", "kestrel", "--detach").code == 0
    assert yard.requested[0]["mission"]["steps"] == [{"id": "up", "do": {"eye": "takeoff"}}]
    assert yard.requested[0]["robots"] == {"eye": ["kestrel"]}
    (place / "patrol.yaml").write_text(MISSION.replace("takeoff", "7"))
    result = fleet("mission", "run", "patrol.yaml")
    assert result.code == 3
    assert "patrol.yaml:4:" in result.err


def test_a_plan_is_flown_by_one_aircraft(fleet, yard, place):
    (place / "field.json").write_text(json.dumps(PLAN))
    assert fleet("mission", "run", "field.json").code == 2
    assert fleet("mission", "run", "field.json", "--robot", "kestrel", "--detach").code == 0
    (step,) = yard.requested[0]["mission"]["steps"]
    assert step["do"]["pilot"]["plan"] == PLAN
    (place / "field.json").write_text("{")
    assert fleet("mission", "run", "field.json", "--robot", "kestrel").code == 5


def test_a_file_is_checked_without_an_edge(fleet, place):
    (place / "patrol.yaml").write_text(MISSION)
    assert fleet("mission", "check", "patrol.yaml").code == 0
    (place / "patrol.yaml").write_text(MISSION.replace("eye: takeoff", "eyes: takeoff"))
    result = fleet("mission", "check", "patrol.yaml")
    assert result.code == 3
    assert (
        "there is no role 'eyes' (did you mean 'eye'?)" in result.err.replace("\n", " ")
        or "eyes" in result.err
    )


def test_a_plan_is_checked_without_an_edge_too(fleet, place):
    (place / "field.json").write_text(json.dumps(PLAN))
    result = fleet("mission", "check", "field.json")
    assert (result.code, "fleet mission run field.json --robot NAME" in result.out) == (0, True)
    (place / "field.plan").write_text('{"fileType": "Plan", "mission": {"items": []}}')
    result = fleet("mission", "check", "field.plan")
    assert (result.code, "field.plan: items: an array of 1 to" in result.err) == (3, True)


def test_missions_and_runs_are_shown(fleet, yard):
    yard.runs = [state(question=PendingQuestion(2, "Go on?", 30.0, "abort"))]
    assert "patrol" in fleet("mission", "ls").out
    assert "1. up" in fleet("mission", "show", "patrol").out
    shown = fleet("mission", "ps").out
    assert "run 3f2a of patrol carries out step up (0 s since its start)" in shown
    assert "It asks: Go on? Answer within 30 s, else: abort" in shown
    assert "kestrel  eye   takeoff  arm done > takeoff ..." in shown
    assert fleet("mission", "show", "patroll").code == 5


def test_on_a_terminal_runs_are_followed_until_they_have_ended(terminal, yard):
    shown = terminal("mission", "ps")
    shown.reads("arm done > takeoff ...")
    yard.runs = [msgspec.structs.replace(state(), step="down.2")]
    shown.reads("carries out step down")
    yard.runs = []
    shown.reads("no run is under way")
    assert shown.ended() == 0


def test_what_a_run_left_behind_is_listed(fleet, yard):
    yard.results = [RunFile("track", "kestrel", "/state/results/3f2a/track-kestrel.csv", 900, 30)]
    listed = fleet("mission", "results", "3f2a")
    assert "track  kestrel  30 points  /state/results/3f2a/track-kestrel.csv" in listed.out
    assert "1 lines" in listed.out
    assert fleet("mission", "results", "--json").json["results"][0]["points"] == 30


@pytest.mark.parametrize("word", ["pause", "resume", "abort"])
def test_the_only_run_under_way_is_meant(fleet, yard, word):
    assert fleet("mission", word).code == 0
    assert yard.requested[0]["do"] == word
    yard.refusal = "not possible while it is paused"
    result = fleet("mission", word, "3f")
    assert (result.code, "run 3f2a: not possible" in result.err) == (5, True)


def test_a_question_is_answered_by_its_number(fleet, yard):
    yard.runs = [state(question=PendingQuestion(2, "Go on?", 30.0, "abort"))]
    assert fleet("mission", "answer", "continue").code == 0
    assert (yard.requested[0]["question"], yard.requested[0]["goes_on"]) == (2, True)


def test_of_several_runs_one_must_be_named(fleet, yard):
    yard.runs = [state(), msgspec.structs.replace(state(), run="77aa")]
    result = fleet("mission", "abort")
    assert result.code == 5
    assert "name one" in result.err
    yard.runs = []
    assert fleet("mission", "abort").code == 5


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        (
            {"phase": "occupying", "waits_for": "gate, which run 7 of patrol has"},
            "run 3f2a of patrol waits for its places (0 s since its start): gate, which run 7 of patrol has",
        ),
        ({"phase": "paused"}, "run 3f2a of patrol is paused in step up (0 s since its start)"),
        (
            {"outcome": "completed_with_losses", "reason": "x"},
            "run 3f2a of patrol has ended: completed with losses: x",
        ),
    ],
)
def test_a_run_is_reported_in_a_sentence(fields, line):
    assert state_line(msgspec.structs.replace(state(), **fields)) == line


@pytest.mark.parametrize(
    ("robot", "line"),
    [
        (RunRobot("spot", "eye", "spare", within=False), "spot (eye) is a spare"),
        (RunRobot("spot", "eye"), "spot (eye) waits for its next step"),
        (
            RunRobot("spot", "eye", "", within=False, outcome="lost", reason="no heartbeat"),
            "spot (eye) is out of the run, because it does not answer: no heartbeat",
        ),
    ],
)
def test_a_robot_of_a_run_is_reported_in_a_sentence(robot, line):
    assert robot_lines(msgspec.structs.replace(state(), robots=(robot,))) == [line]


def test_the_story_of_a_run_is_reported_in_sentences(fleet, yard):
    yard.story = [
        RunLogEntry(1000.0, "begins takeoff", "up.1", "kestrel"),
        RunLogEntry(1001.0, "anna paused the run"),
    ]
    shown = fleet("mission", "log", "3f2a").out
    assert "kestrel begins takeoff (step up)\n" in shown
    assert shown.endswith(" anna paused the run\n")
