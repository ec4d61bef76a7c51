"""Missions are checked before anything moves: each problem with its place, and what to write instead."""

import json

import pytest

from fleet.config.missions import KnownNames, mission_of, read_mission
from fleet.config.problems import InvalidConfig
from fleet.errors import Refused
from fleet.missions.program import Again, Do, Loop

GOOD = """
version: 1
inputs: {height: {type: number, default: 5, min: 3, max: 30}}
roles:
  eye: {from: kestrel, can: [takeoff]}
  feet: {from: yard, count: {min: 1, max: 2}}
quorum: {feet: 1}
steps:
  - id: up
    do: {eye: {command: takeoff, with: {altitude: {input: height}}, timeout: 60 s}}
    undo: {eye: land}
  - id: round
    repeat:
      times: 3
      until: {role: eye, battery: {max: 40}}
      steps:
        - {id: there, finish: any, do: {eye: {goto: [1, 2, 3]}, feet: {path: [[0, 0], [1, 1]], retry: 1}}}
        - {id: rest, wait: 1 min}
  - {id: home, do: {all: return_to_home}}
on_failure: undo
"""
KNOWN = KnownNames(["kestrel", "beast", "yard"], ["dock-1"], on_earth=False)


@pytest.fixture
def mission(tmp_path):
    """Write a mission, GOOD with one text in the place of another; gives what reads it."""

    def mission(instead="", of=""):
        assert of in GOOD
        file = tmp_path / "patrol.yaml"
        file.write_text(GOOD.replace(of, instead, 1) if of else GOOD)
        return read_mission(file, {}, KNOWN)

    return mission


def test_a_mission_becomes_a_program_of_instructions(mission):
    program = mission().program({"height": 7})
    up, loop, there, rest, again, home = program.steps
    assert isinstance(up, Do)
    assert isinstance(loop, Loop)
    assert (up.acts["eye"][0].data, up.acts["eye"][0].timeout) == ({"altitude": 7}, 60.0)
    assert (loop.times, loop.end, again) == (3, 5, Again(1))
    assert (there.finish, there.acts["feet"][0].retry, rest.seconds) == ("any", 1, 60.0)
    assert home.acts["all"][0].value == "return_to_home"
    assert program.quorum == {"eye": 1, "feet": 1}


@pytest.mark.parametrize(
    ("instead", "of", "line", "message"),
    [
        ("from: kestral", "from: kestrel", 5, "there is no robot or group 'kestral'"),
        ("{feat: 1}", "{feet: 1}", 7, "there is no role 'feat'"),
        ("{feet: 5}", "{feet: 1}", 7, "must be 0 to 2, the most that fill the role"),
        ("{all: {goto: dock-9}}", "{all: return_to_home}", 19, "there is no place 'dock-9'"),
        ("{eyes: land}", "{eye: land}", 11, "there is no role 'eyes'"),
        ("60 sec", "60 s", 10, "'60 sec' is no duration: write 60 s, 12 min or 1 h"),
        ("{input: hight}", "{input: height}", 10, "there is no input 'hight'"),
        ("id: up,", "id: rest,", 18, "there is another step 'up'"),
        ("version: 2", "version: 1", 2, "must be 1"),
        ("takeoff, retry: 1,", "takeoff,", 10, "takeoff must not be done twice"),
        ("command: takeoff, goto: [1, 1],", "command: takeoff,", 10, "needs exactly one of command, goto"),
        ("wait: 1 min, ask: {text: Eh}", "wait: 1 min", 18, "needs exactly one of do, wait"),
        ("finish: nose", "finish: any", 17, "there is no role 'nose'"),
        ("role: nose, battery", "role: eye, battery", 15, "there is no role 'nose'"),
        ("path: way.csv", "path: [[0, 0], [1, 1]]", 17, "way.csv: cannot be read: "),
        ("path: [[0], [1, 1]]", "path: [[0, 0], [1, 1]]", 17, "a point is [x, y] or [x, y, z] in metres"),
        ("path: [[0, 0], way.csv]", "path: [[0, 0], [1, 1]]", 17, "a list of paths has a file or a list"),
        ("goto: {lat: 47}", "goto: [1, 2, 3]", 17, "a point is [x, y] or [x, y, z] in metres"),
        ("goto: {lat: 47, lon: 200}", "goto: [1, 2, 3]", 17, "lat and lon are degrees"),
        ("goto: {lat: 47, lon: 8}", "goto: [1, 2, 3]", 17, "the site's position on Earth is unknown"),
        ("times: 0", "times: 3", 14, "must be at least 1"),
        ("{eye: {command: land, wiht: {}}}", "{eye: land}", 11, "unknown key"),
        ("on_failure: undo\non_abort: takeoff", "on_failure: undo", 21, "takeoff makes nothing safer"),
        ("on_failure: undo\noccupies: [gate]", "on_failure: undo", 21, "there is no place 'gate'"),
    ],
)
def test_each_problem_is_reported_with_its_place(mission, instead, of, line, message):
    with pytest.raises(InvalidConfig) as caught:
        mission(instead, of)
    found = [(each.line, message in each.message) for each in caught.value.problems]
    assert (line, True) in found, caught.value.problems
    assert all(each.column > 1 for each in caught.value.problems)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"height": 31}, "input height: must be at most 30"),
        ({"height": "5"}, "input height: must be number, not '5'"),
        ({"height": True}, "input height: must be number, not True"),
        ({"hight": 5}, "there is no input 'hight'"),
    ],
)
def test_inputs_are_checked_when_they_are_given(mission, given, why):
    with pytest.raises(Refused, match=why):
        mission().program(given)


def test_an_input_without_a_default_must_be_given(mission):
    with pytest.raises(Refused, match="input height: must be given"):
        mission("type: number,", "type: number, default: 5,").program({})


def test_a_plan_that_is_missing_or_not_flown_here_is_reported_at_its_place(mission, tmp_path):
    plan = "{all: {plan: field.plan}}", "{all: return_to_home}"
    with pytest.raises(InvalidConfig, match=r"patrol.yaml:19:\d+: .*field.plan: No such file"):
        mission(*plan)
    (tmp_path / "field.plan").write_text(json.dumps({"fileType": "Plan", "mission": {"items": []}}))
    with pytest.raises(InvalidConfig, match=r"field.plan: .*an array of 1 to"):
        mission(*plan)


def test_a_place_may_be_an_input(tmp_path):
    steps = "[{id: x, do: {a: {goto: {input: to}}}}]"
    text = f"version: 1\ninputs: {{to: {{type: place}}}}\nroles: {{a: {{}}}}\nsteps: {steps}"
    (tmp_path / "deliver.yaml").write_text(text)
    program = read_mission(tmp_path / "deliver.yaml", {}, KNOWN).program({"to": "dock-1"})
    assert program.steps[0].acts["a"][0].value == "dock-1"


def test_a_mission_that_is_sent_names_no_files():
    steps = [{"id": "x", "do": {"a": {"path": "way.csv"}}}]
    with pytest.raises(InvalidConfig, match="has the content of its files in it"):
        mission_of("patrol", {"version": 1, "roles": {"a": {}}, "steps": steps})


def test_a_mission_that_is_sent_is_checked_as_strictly(mission):
    data = mission().data
    assert mission_of("patrol", data).program({}).mission == "patrol"
    with pytest.raises(InvalidConfig, match="must be 1"):
        mission_of("patrol", {**data, "version": 2})
    for nonsense in (
        None,
        7,
        [],
        "x",
        {},
        {"steps": 3},
        {**data, "steps": [None]},
        {**data, "roles": {"a": 1}},
    ):
        with pytest.raises(InvalidConfig):
            mission_of("patrol", nonsense)
