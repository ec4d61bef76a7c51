"""A mission is shown in sentences."""

import pytest

from fleet.config.missions import mission_of
from fleet.missions.grammar_words import role_words, step_words

MISSION = {
    "version": 1,
    "roles": {
        "eye": {"kind": "mavlink", "can": ["takeoff"]},
        "feet": {"from": "yard", "count": {"min": 2, "max": 4}, "spares": 1},
        "rest": {"count": {"min": 1}},
    },
    "steps": [
        {"id": "up", "start": "together", "do": {"eye": "takeoff", "feet": {"goto": [1, 2]}}},
        {"id": "calm", "wait": "1 min", "if": {"role": "eye", "health": "ok"}},
        {"id": "seen", "wait_for": {"role": "eye", "event": "person_seen", "timeout": "30 s"}},
        {"id": "closer", "ask": {"text": "Closer?"}},
        {
            "id": "rounds",
            "repeat": {
                "times": 3,
                "until": {"role": "all", "battery": {"max": 40}},
                "steps": [{"id": "round", "do": {"feet": {"path": [[1, 2]]}, "eye": {"mission": "scan"}}}],
            },
        },
    ],
}


@pytest.fixture
def config():
    mission = {**MISSION, "steps": MISSION["steps"][:4]}
    return mission_of("patrol", mission).config


def test_roles(config):
    assert [role_words(role) for role in config.roles.values()] == [
        "1 robot of the kind mavlink with the command takeoff",
        "2 to 4 robots from yard and 1 spare",
        "at least 1 robot",
    ]


def test_steps(config):
    assert [step_words(step) for step in config.steps] == [
        "up: together, eye does takeoff, feet goes to [1.0, 2.0]",
        "calm: wait 60 s if any of eye is ok",
        "seen: wait until any of eye reports person_seen, 30 s at the most",
        "closer: ask a person: Closer?",
    ]


def test_repeats():
    steps = [{**MISSION["steps"][4]["repeat"]["steps"][0], "do": {"feet": {"path": [[1, 2]]}}}]
    repeat = {"id": "rounds", "repeat": {**MISSION["steps"][4]["repeat"], "steps": steps}}
    (step,) = mission_of("patrol", {**MISSION, "steps": [repeat]}).config.steps
    words = "rounds: 3 times or until the battery of any of all is at most 40 %: round: feet follows a path"
    assert step_words(step) == words
