"""``fleet mission rehearse``: followed, shown as a page, and its exit codes."""

import json

import msgspec
import pytest

from fleet.bus import keys
from fleet.missions.rehearsal import (
    ClosestApproach,
    RehearsalNote,
    RehearsalResult,
    RehearsalState,
    RehearsedPart,
    RehearsedRobot,
)
from fleet.missions.report import MissionState

RESULT = RehearsalResult(
    "patrol",
    "completed",
    26.0,
    robots=(
        RehearsedRobot("kestrel", "simulated PX4 multirotor", False, "eye", "done", "", 90.0, 84.4),
        RehearsedRobot("rex", "stand-in that stands where the robot is", stand_in=True),
    ),
    timeline=(
        RehearsedPart("up.1", "kestrel", "eye", "takeoff", 0.0, 9.4, "done"),
        RehearsedPart("home.2", "kestrel", "eye", "land", 9.4),
    ),
    approaches=(ClosestApproach(("kestrel", "rex"), 4.49, 24.1, 1.9),),
    assumed=("a person answers 'Sure?' with: continue",),
    took=0.5,
    pass_until=2_000_000_000.0,
)


class Rehearsing:
    """Plays the part of an edge that rehearses."""

    def __init__(self, edge):
        self.requested = []
        self.begun = RehearsalState("7f", roles={"eye": ["kestrel"]})
        notes = [
            RehearsalNote(0.0, "begins takeoff", "up.1", "kestrel"),
            RehearsalNote(26.0, "The run has ended: completed"),
        ]
        self.states = [
            RehearsalState("7f", seconds=9.4, step="up.1", notes=tuple(notes[:1])),
            RehearsalState("7f", seconds=26.0, step="end", notes=tuple(notes[1:]), result=RESULT),
        ]
        edge._control.declare_queryable(keys.mission("yard-1", "*"), self._answer)

    def _answer(self, question):
        do, name = question.parameters.get("do"), question.requested.rpartition("/")[2]
        if do is None:
            state = MissionState("patrol", "yard-1")
        else:
            self.requested.append((do, json.loads(question.payload)))
            state = self.begun if do == "rehearse" else self.states.pop(0)
        question.reply(msgspec.json.encode(state), keys.mission("yard-1", name if do else "patrol"))
        question.close()


@pytest.fixture
def yard(play_edge):
    return Rehearsing(play_edge("yard-1", robots={"kestrel": {"health": "ok"}}))


def ends(yard, **fields):
    """Let the rehearsal end in another way."""
    yard.states = [RehearsalState("7f", result=msgspec.structs.replace(RESULT, **fields))]


def test_a_rehearsal_is_followed_and_shown_as_a_page(fleet, yard):
    result = fleet("mission", "rehearse", "patrol", "height=4", "--robot", "eye=kestrel")
    assert result.code == 0
    (_, request), *looks = yard.requested
    assert (request["inputs"], request["robots"]) == ({"height": 4}, {"eye": ["kestrel"]})
    assert [look for _, look in looks] == [{"id": "7f", "since": 0}, {"id": "7f", "since": 1}]
    assert result.err.splitlines() == [
        "eye: kestrel",
        "     0.0 s  kestrel begins takeoff (step up)",
        "    26.0 s  The run has ended: completed",
    ]
    out = result.out.splitlines()
    assert out[:2] == ["rehearsal of patrol: passed (completed)", "26 s simulated in 0.5 s, seed 1"]
    for line in (
        "  kestrel  eye: done, battery 90 % to 84 %, simulated PX4 multirotor",
        "  rex  stand-in that stands where the robot is",
        "      0.0     9.4  up.1  kestrel takeoff: done",
        "      9.4          home.2  kestrel land: under way",
        "    4.49 m  kestrel and rex, after 24.1 s; 1.9 m are kept",
        "  a person answers 'Sure?' with: continue",
    ):
        assert line in out
    assert out[-1].startswith(
        "start it: fleet mission run patrol height=4 --robot eye=kestrel  (counts until "
    )


def test_programs_get_the_whole_result(fleet, yard):
    result = fleet("mission", "rehearse", "patrol", "--json")
    assert result.json["passed"] is True
    assert result.json["approaches"] == [
        {"robots": ["kestrel", "rex"], "metres": 4.49, "at": 24.1, "kept": 1.9}
    ]


@pytest.mark.parametrize(
    ("outcome", "code"),
    [("completed", 8), ("completed_with_losses", 7), ("failed", 8), ("undone", 8), ("unknown", 9)],
)
def test_what_is_no_pass_says_why_and_has_the_exit_code_of_such_a_run(fleet, yard, outcome, code):
    ends(yard, outcome=outcome, troubles=("kestrel and rex came within 0.9 m",), pass_until=0.0)
    result = fleet("mission", "rehearse", "patrol")
    assert result.code == code
    assert f"rehearsal of patrol: not passed ({outcome})" in result.out
    assert "  kestrel and rex came within 0.9 m" in result.out
    assert "start it" not in result.out


def test_where_nobody_is_placed_the_closest_approach_is_not_known(fleet, yard):
    ends(yard, approaches=())
    assert "unknown: no two robots are placed" in fleet("mission", "rehearse", "patrol").out


@pytest.mark.parametrize(
    ("begun", "states", "why"),
    [
        (RehearsalState(refusal="role eye needs 1, 0 can"), [], "role eye needs 1, 0 can"),
        (
            RehearsalState("7f"),
            [RehearsalState("7f", failure="its process ended: boom")],
            "it cannot be rehearsed: its process ended: boom",
        ),
        (
            RehearsalState("7f"),
            [RehearsalState(refusal="there is no rehearsal '7f'")],
            "there is no rehearsal",
        ),
    ],
)
def test_what_cannot_be_rehearsed_is_reported(fleet, yard, begun, states, why):
    yard.begun, yard.states = begun, states
    result = fleet("mission", "rehearse", "patrol")
    assert (result.code, why in result.err) == (5, True)


def test_a_long_rehearsal_tells_how_far_it_is(fleet, yard, monkeypatch):
    monkeypatch.setattr("fleet.cli.rehearsals.QUIET", 0.0)
    yard.states[:1] = [RehearsalState("7f"), RehearsalState("7f", seconds=9.4, step="up.1")]
    err = fleet("mission", "rehearse", "patrol").err
    assert "0.0 s  the simulated robots start" in err
    assert "9.4 s  step up.1" in err
