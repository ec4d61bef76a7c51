"""Missions rehearsed with simulated robots, in simulated time."""

import pathlib
import socket

import msgspec
import pytest
import zenoh

from fleet.config.missions import KnownNames, read_mission
from fleet.rehearsal import rehearsal
from fleet.rehearsal.rehearsal import rehearse

EXAMPLES = sorted((pathlib.Path(__file__).parents[3] / "examples").glob("*.yaml"))
INPUTS = {"deliver": {"x": 2, "y": -3}}
FEW = {"ugv": {"battery_policy": {"endurance": 300}}}
ROVER = {"rover": {"kind": "ugv"}}


def roles_of(field, mission):
    """Return robots of the kinds that a mission's roles ask for, as many as these must have."""
    free = {name: state.adapter for name, state in field.states.items()}
    groups = field.loaded.config.members
    found = {}
    for role, wanted in mission.config.roles.items():
        fits = [
            name
            for name, kind in free.items()
            if wanted.kind in (None, kind)
            and (wanted.from_ in (None, name) or name in groups.get(wanted.from_, ()))
        ]
        found[role] = fits[: wanted.count.min]
        free = {name: kind for name, kind in free.items() if name not in found[role]}
    return found


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_rehearsed_to_a_good_end(path, field):
    yard = field(**FEW)
    yard.state("ugv-1", battery=41.0)
    mission = read_mission(path, {}, KnownNames())
    result = yard.result(mission, roles_of(yard, mission), **INPUTS.get(path.stem, {}))
    assert (result.outcome, result.troubles) == ("completed", ())
    assert result.passed
    assert result.took < result.seconds
    assert all(part.outcome == "done" for part in result.timeline)


def go(*point, role="rover", **more):
    return {"id": "go", "do": {role: {"goto": list(point)}}, **more}


def test_the_same_seed_gives_the_same_result(field):
    yard = field()
    mission = {
        "roles": {"eye": {"kind": "mavlink"}, **ROVER},
        "steps": [
            {"id": "up", "do": {"eye": {"command": "takeoff", "with": {"altitude": 4}}}},
            {
                "id": "round",
                "start": "together",
                "do": {"eye": {"goto": [6, 6, 5]}, "rover": {"goto": [2, -2]}},
            },
            {"id": "home", "do": {"eye": "land"}},
        ],
    }
    roles = {"eye": ["drone-1"], "rover": ["ugv-1"]}
    first, second = (msgspec.structs.replace(yard.result(mission, roles), took=0.0) for _ in range(2))
    assert first == second
    assert [(part.step, part.robot, part.does) for part in first.timeline] == [
        ("up.1", "drone-1", "takeoff"),
        ("round.2", "drone-1", "goto"),
        ("round.2", "ugv-1", "goto"),
        ("home.3", "drone-1", "land"),
    ]


def test_robots_begin_where_they_are_now_and_as_full(field):
    yard = field(**FEW)
    yard.state("ugv-1", site=yard.states["ugv-1"].site + yard.states["ugv-1"].site, battery=60.0)
    result = yard.result({"roles": ROVER, "steps": [go(2, -4)]}, {"rover": ["ugv-1"]})
    (robot,) = [each for each in result.robots if each.role]
    assert robot.battery_before == pytest.approx(60.0, abs=1.0)
    assert 50.0 < robot.battery_left < robot.battery_before
    (part,) = result.timeline
    assert 3.0 < part.ended < 12.0  # two metres straight ahead


def test_what_a_fence_refuses_fails_the_rehearsal_with_its_words(field):
    square = [[[-1, -1], [1, -1], [1, 1], [-1, 1]]]
    yard = field(**{"ugv-1": {"fence": {"inclusion": square}}})
    result = yard.result({"roles": ROVER, "steps": [go(5, -2)]}, {"rover": ["ugv-1"]})
    assert (result.passed, result.outcome) == (False, "failed")
    assert "fence" in " ".join(result.troubles)


def test_the_host_keeps_robots_apart_and_the_nearest_that_they_came_is_reported(field):
    yard = field(ugvs=2)
    mission = {
        "roles": {"one": {"kind": "ugv"}, "other": {"kind": "ugv"}},
        "quorum": {"other": 0},
        "steps": [{"id": "meet", "do": {"one": {"goto": [3, -3]}, "other": {"goto": [3, -3]}}}],
    }
    result = yard.result(mission, {"one": ["ugv-1"], "other": ["ugv-2"]})
    assert (result.passed, result.outcome) == (False, "completed_with_losses")
    assert "ugv-2: refused: goal 1 is 0.0 m from ugv-1's way" in result.troubles[-1]
    (nearest,) = [each for each in result.approaches if each.robots == ("ugv-1", "ugv-2")]
    assert nearest.metres > nearest.kept == 0.8
    assert 0.0 < nearest.at < result.seconds
    track = {each.robot: each.points for each in result.tracks}["ugv-1"]
    assert track[-1][1:3] == (pytest.approx(3, abs=0.5), pytest.approx(-3, abs=0.5))
    assert 5 < len(track) < 100


def test_a_robot_without_a_simulator_gets_a_stand_in_that_is_named(field):
    result = field().result(
        {"roles": {"dog": {"kind": "quadruped"}}, "steps": [go(1, -4, role="dog")]}, {"dog": ["dog-1"]}
    )
    (dog,) = [each for each in result.robots if each.role]
    assert (dog.stand_in, result.passed) == (True, True)
    assert dog.played_by == "kinematic stand-in: quadruped has no simulator that runs in simulated time"
    assert {each.played_by for each in result.robots if not each.role} == {
        "stand-in that stands where the robot is"
    }


def test_questions_are_answered_and_waits_for_the_world_are_cut_short_and_both_are_reported(field):
    mission = {
        "roles": ROVER,
        "steps": [
            {"id": "sure", "ask": {"text": "Sure?", "on_timeout": "abort"}},
            {"id": "seen", "wait_for": {"role": "rover", "event": "person_seen", "timeout": "6 h"}},
            go(1, -2),
        ],
    }
    result = field().result(mission, {"rover": ["ugv-1"]})
    assert result.passed
    assert result.seconds < 60
    assert result.assumed == (
        "a person answers 'Sure?' with: continue",
        "what step seen waits for comes, or its time runs out",
    )


def test_robots_are_sent_to_the_places_of_fleet_yaml(field):
    steps = [{"id": "go", "do": {"rover": {"goto": "gate"}}}]
    result = field().result({"roles": {"rover": {"from": "ugvs"}}, "steps": steps}, {"rover": ["ugv-1"]})
    assert result.passed
    assert 1.0 < result.timeline[0].ended < 10.0


def test_what_is_left_out_of_the_rehearsal_is_reported(field):
    yard = field()
    yard.state("dog-1", site=None, placement=None)
    yard.state("drone-1", activity="goto")
    result = yard.result({"roles": ROVER, "steps": [go(1, -2)]}, {"rover": ["ugv-1"]})
    assert result.assumed == (
        "drone-1 stays where it is, though it moves now",
        "dog-1 is ignored: its position is unknown",
    )


def test_a_mission_that_must_be_rehearsed_is_rehearsed(field):
    mission = {"roles": ROVER, "rehearse": "required", "steps": [go(1, -2)]}
    assert field().result(mission, {"rover": ["ugv-1"]}).passed


@pytest.mark.parametrize(
    ("robot", "fields", "why"),
    [
        ("drone-1", {"armed": True}, "its motors run"),
        ("drone-1", {"site": None, "placement": None}, "its position on Earth is unknown"),
    ],
)
def test_an_aircraft_that_flies_or_is_nowhere_is_not_rehearsed(field, robot, fields, why):
    yard = field()
    yard.state(robot, **fields)
    mission = {"roles": {"eye": {"kind": "mavlink"}}, "steps": [{"id": "up", "do": {"eye": "takeoff"}}]}
    line = yard.rehearse(mission, {"eye": [robot]})
    assert why in line.failure
    assert line.result is None


def test_who_may_not_start_the_mission_cannot_rehearse_it(field):
    yard = field()
    task = yard.task({"roles": ROVER, "steps": [go(1, -2)]}, {"rover": ["ugv-1"]})
    line = rehearse(msgspec.structs.replace(task, source_type="edit"), lambda _line: None)
    assert line.failure.startswith("ugv-1: source_type 'edit'; this robot accepts")


def test_a_rehearsal_that_takes_too_long_is_no_pass(field):
    task = field().task({"roles": ROVER, "steps": [go(5, -2)]}, {"rover": ["ugv-1"]})
    result = rehearse(task, lambda _line: None, within=0.0).result
    assert (result.outcome, result.passed) == ("unknown", False)
    assert "were simulated when its 0 min were over" in result.reason


def test_it_joins_no_bus_and_opens_no_socket(field, monkeypatch):
    def opened(*_):
        raise AssertionError("it opens something")

    task = field().task(
        {"roles": {**ROVER, "eye": {}}, "steps": [go(1, -2)]}, {"rover": ["ugv-1"], "eye": ["drone-1"]}
    )
    monkeypatch.setattr(zenoh, "open", opened)
    monkeypatch.setattr(socket.socket, "connect", opened)
    monkeypatch.setattr(socket.socket, "bind", opened)
    assert rehearse(task, lambda _line: None).result.passed


def test_it_tells_how_far_it_is(field, monkeypatch):
    monkeypatch.setattr(rehearsal, "TELL", 0.0)
    lines = []
    rehearse(field().task({"roles": ROVER, "steps": [go(2, -2)]}, {"rover": ["ugv-1"]}), lines.append)
    texts = [line.note.text for line in lines if line.note]
    assert texts == ["begins goto", "has finished goto", "The run has ended: completed"]
    seconds = [line.seconds for line in lines if line.note is None]
    assert seconds == sorted(seconds)
    assert len(seconds) > 5
