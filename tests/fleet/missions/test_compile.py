"""A mission within a mission becomes a part of the same program, under names of its own."""

import pytest

from fleet.config.missions import mission_of
from fleet.errors import Refused
from fleet.missions.program import Do, Enter, Leave, Require

SCAN = {
    "version": 1,
    "inputs": {"height": {"type": "number", "max": 30}},
    "roles": {"eye": {"can": ["goto"]}, "feet": {"count": {"min": 1, "max": 2}}},
    "require": {"health": "ok", "battery": {"min": 30}},
    "occupies": ["gate"],
    "quorum": {"feet": 0},
    "deadline": "5 min",
    "steps": [
        {"id": "near", "do": {"eye": {"goto": [1, 2, {"input": "height"}]}}, "finish": "eye"},
        {"id": "back", "if": {"role": "all", "health": "ok"}, "do": {"all": "return_to_home"}},
    ],
}
OUTER = {
    "version": 1,
    "roles": {"team": {"count": 3}},
    "require": {"battery": {"min": 60}},
    "occupies": ["pad"],
    "steps": [
        {
            "id": "look",
            "do": {"team": {"mission": "scan", "with": {"height": 7}}},
            "robot_failed": {"do": "land", "then": "wait"},
        },
        {"id": "home", "do": {"all": "land"}},
    ],
}


def program(outer=OUTER, **others):
    known = {name: mission_of(name, data) for name, data in {"scan": SCAN, **others}.items()}
    for name, mission in known.items():
        known[name] = type(mission)(name, mission.data, mission.config, known)
    return mission_of("patrol", outer, known).program({})


def test_its_steps_stand_between_their_beginning_and_their_end():
    found = program()
    enter, near, back, leave, home = found.steps
    assert (enter.mission, enter.end, enter.role, leave) == ("scan", 4, "look.all", Leave(0, "look"))
    assert (enter.quorum, enter.deadline) == ({"look.eye": 1, "look.feet": 0}, 300.0)
    assert (enter.failed_do, enter.failed_then) == ("land", "wait")
    assert (near.id, near.finish, near.acts["look.eye"][0].value) == ("look.near", "look.eye", [1, 2, 7])
    assert (back.only_if.role, set(back.acts)) == ("look.all", {"look.all"})
    assert set(home.acts) == {"all"}


def test_it_requires_what_both_require():
    found = program()
    _, near, _, _, home = found.steps
    assert near.require == Require("ok", 60.0)
    assert home.require is None
    assert found.require == Require("degraded", 60.0)


def test_the_places_of_both_are_occupied():
    assert program().occupies == ("gate", "pad")


def test_its_roles_are_known_by_the_step_that_carries_it():
    (inner,) = program().inner.values()
    assert inner.carrier == "team"
    assert {name: (need.least, need.most) for name, need in inner.roles.items()} == {
        "look.eye": (1, 1),
        "look.feet": (1, 2),
    }


def test_missions_stand_within_each_other():
    middle = {
        **{key: SCAN[key] for key in ("version", "roles")},
        "steps": [{"id": "all-of-it", "do": {"all": {"mission": "scan", "with": {"height": 3}}}}],
    }
    outer = {**OUTER, "steps": [{"id": "go", "do": {"team": {"mission": "middle"}}}]}
    found = program(outer, middle=middle)
    assert [step.id for step in found.steps if isinstance(step, Enter | Do)] == [
        "go",
        "go.all-of-it",
        "go.all-of-it.near",
        "go.all-of-it.back",
    ]
    assert list(found.inner) == ["go", "go.all-of-it"]
    assert found.inner["go.all-of-it"].carrier == "go.all"


def test_an_input_out_of_bounds_is_reported_with_its_step_when_it_is_given():
    outer = {**OUTER, "inputs": {"up": {"type": "number", "default": 5}}}
    outer["steps"] = [
        {"id": "look", "do": {"team": {"mission": "scan", "with": {"height": {"input": "up"}}}}}
    ]
    known = {"scan": mission_of("scan", SCAN)}
    mission = mission_of("patrol", outer, known)
    assert mission.program({"up": 30}).steps
    with pytest.raises(Refused, match="step look: mission scan: input height: must be at most 30"):
        mission.program({"up": 31})


def test_a_mission_that_nobody_knows_is_refused():
    with pytest.raises(Refused, match="step look: there is no mission 'scan'"):
        mission_of("patrol", OUTER).program({})
