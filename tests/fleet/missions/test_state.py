"""The position of a run and what may follow it: phases only go forward once the end has begun."""

import itertools

import msgspec
import pytest

from fleet.missions.program import Act, Again, Do, Program, Require, Wait
from fleet.missions.state import (
    GOING_ON,
    NEXT,
    PartOutcome,
    Phase,
    Question,
    RunHead,
    RunMember,
    RunOutcome,
    StepPart,
    UndoableStep,
    instruction_of,
    required,
    step_name,
)

ACTS = {"all": (Act("goto", [1, 1]),)}
STRICT = Require("ok", 60.0)
STEPS = (Do("go", ACTS), Wait("rest", 5.0), Again(0), Do("in.go", ACTS, require=STRICT))
PROGRAM = Program("patrol", STEPS, {}, Require(battery_min=20.0))


@pytest.mark.parametrize(
    ("at", "instruction", "name"),
    [
        (0, STEPS[0], "go.7"),
        (1, STEPS[1], "rest.7"),
        (2, STEPS[2], "repeat.7"),
        (3, STEPS[3], "in.go.7"),
        (4, None, "end"),
        (9, None, "end"),
    ],
)
def test_a_step_is_called_by_its_name_and_the_number_of_its_repetition(at, instruction, name):
    head = RunHead(Phase.STEP, at=at, serial=7)
    assert instruction_of(PROGRAM, head) is instruction
    assert step_name(PROGRAM, head) == name


@pytest.mark.parametrize(
    ("at", "require"), [(0, PROGRAM.require), (1, PROGRAM.require), (3, STRICT), (4, PROGRAM.require)]
)
def test_a_step_of_an_inner_mission_requires_what_that_says(at, require):
    assert required(PROGRAM, RunHead(at=at)) == require


ORDER = [Phase.HALTING, Phase.UNDOING, Phase.ENDING, Phase.ENDED]


def test_every_phase_goes_on_or_ends():
    assert frozenset(NEXT) == frozenset(Phase) == GOING_ON | set(ORDER)
    assert GOING_ON.isdisjoint(ORDER)


@pytest.mark.parametrize(("before", "after"), list(itertools.product(ORDER, Phase)))
def test_from_an_end_that_has_begun_nothing_goes_back(before, after):
    back = after in GOING_ON or ORDER.index(after) < ORDER.index(before)
    if back or before is Phase.ENDED:
        assert after not in NEXT[before]
    else:
        assert after in NEXT[before]


@pytest.mark.parametrize("before", sorted(GOING_ON))
def test_a_run_that_goes_on_may_end_at_any_time_and_is_never_new_again(before):
    assert set(ORDER) <= NEXT[before]
    assert Phase.NEW not in NEXT[before]


def test_a_part_is_under_way_until_it_has_an_outcome():
    part = StepPart("run/go.1/rex/1", "go.1", "rex", "eye", 1, "do", ACTS["all"][0], 0.0, 60.0)
    assert part.inflight
    part.outcome = PartOutcome.UNKNOWN
    assert not part.inflight


@pytest.mark.parametrize(
    "saved",
    [
        RunHead(),
        RunHead(
            Phase.PAUSED,
            3,
            8,
            {"0": 2},
            {"1": 4.5},
            99.0,
            "spot",
            "gate, which run 7 has",
            Question(2, "Go on?", 30.0, "fail", "robot"),
            2,
            Phase.STEP,
            12.5,
            [UndoableStep(0, "go.1"), UndoableStep(3, "in.go.2")],
            RunOutcome.UNDONE,
            RunOutcome.UNDO_FAILED,
            "so it was",
        ),
        RunMember(
            "rex", "eye", 1, {"in.eye": 0}, False, False, PartOutcome.TAKEN, "anna", 4.0, (1.0, 2.0, 3.0)
        ),
        RunMember("spot", "feet", 0, ours=False, within=False, spare=True, replaced=True),
        StepPart(
            "r/go.1/rex/1",
            "go.1",
            "rex",
            "eye",
            2,
            "undo",
            ACTS["all"][0],
            1.0,
            61.0,
            PartOutcome.LATE,
            "so",
            9.0,
        ),
    ],
    ids=lambda saved: type(saved).__name__,
)
def test_what_is_saved_is_read_back_as_it_was(saved):
    assert msgspec.json.decode(msgspec.json.encode(saved), type=type(saved)) == saved


def test_the_steps_to_undo_keep_the_name_that_older_versions_gave_them_on_disk():
    """A run must survive an update of fleet, and be undone by the next version."""
    saved = msgspec.json.decode(msgspec.json.encode(RunHead(undoable=[UndoableStep(0, "go.1")])))
    assert saved["begun"] == [{"at": 0, "step": "go.1"}]
