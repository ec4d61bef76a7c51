"""Runs of missions on the command line: a line for each, and each change once until the end."""

import pytest

from fleet.cli.output import ExitCode
from fleet.cli.runs import follow, robot_lines, run_lines, state_line
from fleet.errors import TimedOut
from fleet.missions.report import PendingQuestion, RunRobot, RunState
from fleet.missions.state import RunOutcome

ASKS = "run 3f2a of patrol asks a person in step up (0 s since its start)"
QUESTION = PendingQuestion(1, "Go on?", 29.6, "abort")


def state(phase="step", **fields):
    return RunState("3f2a", "yard", "patrol", phase, fields.pop("step", "up.1"), 1000.0, **fields)


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"seconds": 12.4}, "run 3f2a of patrol carries out step up (12 s since its start)"),
        (
            {"outcome": "completed_with_losses", "reason": "so it was"},
            "run 3f2a of patrol has ended: completed with losses: so it was",
        ),
        (
            {"phase": "asking", "question": QUESTION},
            f"{ASKS}. It asks: Go on? Answer within 30 s, else: abort",
        ),
        (
            {"problem": "the disk is full"},
            "run 3f2a of patrol carries out step up (0 s since its start). the disk is full",
        ),
    ],
)
def test_a_run_is_told_on_one_line(fields, line):
    assert state_line(state(**fields)) == line


@pytest.mark.parametrize(
    ("robot", "line"),
    [
        (RunRobot("rex", "eye", "goto"), "rex (eye) does goto"),
        (RunRobot("rex", "eye"), "rex (eye) waits for its next step"),
        (RunRobot("rex", "eye", "spare"), "rex (eye) is a spare"),
        (RunRobot("rex", "eye", outcome="done"), "rex (eye) came to the end"),
        (
            RunRobot("rex", "eye", outcome="lost", reason="no cable"),
            "rex (eye) is out of the run, because it does not answer: no cable",
        ),
        (
            RunRobot("rex", "eye", "stop", outcome="failed", reason="it slips"),
            "rex (eye) does stop: it slips",
        ),
        (RunRobot("rex", "eye", outcome="bewitched"), "rex (eye) bewitched"),
    ],
)
def test_a_robot_is_told_by_what_it_does_or_why_it_is_out(robot, line):
    assert robot_lines(state(robots=(robot,))) == [line]


def test_runs_are_shown_with_the_lane_of_each_robot():
    robots = (
        RunRobot("rex", "eye", "goto", lane=("takeoff done", "goto ...")),
        RunRobot("ada", "feet", outcome="lost", reason="no cable", lane=("goto lost",)),
        RunRobot("max", "feet"),
    )
    lines = run_lines([state(robots=robots)], None)
    assert lines[0] == state_line(state())
    assert [line.split() for line in lines[-3:]] == [
        ["rex", "eye", "goto", "takeoff", "done", ">", "goto", "..."],
        ["ada", "feet", "lost", "goto", "lost", "(no", "cable)"],
        ["max", "feet", "waits"],
    ]
    assert run_lines([], 80) == ["no run is under way"]


SLY = RunRobot("rex", "eye", lane=("goto done",), reason="\x1b[2J" + "y" * 200)


def test_no_line_is_longer_than_the_screen_or_does_something_to_it():
    long = state(reason="\x1b[2J" + "x" * 200, robots=(SLY,))
    lines = run_lines([long], 60)
    assert all(len(line) <= 60 for line in lines)
    assert "\x1b" not in "".join(lines)


class Out:
    """What a command shows to people and to programs."""

    def __init__(self):
        self.notes, self.said, self.documents = [], [], []
        self.note, self.say, self.data = self.notes.append, self.said.append, self.documents.append


class Run:
    """A run whose states come one after another, and then perhaps an error."""

    id = "3f2a"

    def __init__(self, *states, then=None):
        self.states, self.then = states, then

    def follow(self):
        yield from self.states
        if self.then is not None:
            raise self.then


GOES = RunRobot("rex", "eye", "goto")


def test_each_change_is_told_once_and_how_it_ended():
    out = Out()
    ended = state("ended", outcome="completed", robots=(RunRobot("rex", "eye", outcome="done"),))
    run = Run(state(robots=(GOES,)), state(robots=(GOES,), seconds=5.0), state("paused"), ended)
    assert follow(out, run) is ExitCode.OK
    assert out.notes == [
        "the run carries out step up",
        "step up: rex (eye) does goto",
        "the run is paused in step up",
    ]
    assert out.said == ["run 3f2a of patrol has ended: completed", "  rex (eye) came to the end"]
    assert out.documents[0]["outcome"] == "completed"


def test_a_question_is_told_with_how_to_answer_and_a_wait_with_for_what():
    out = Out()
    ask = state("asking", question=QUESTION)
    wait = state("occupying", waits_for="gate, which run 7 has")
    follow(out, Run(wait, ask, state("ended", outcome="aborted")))
    assert out.notes == [
        "the run waits for its places: gate, which run 7 has",
        "the run asks a person in step up",
        "it asks: Go on?  fleet mission answer continue|abort 3f2a",
    ]


@pytest.mark.parametrize("outcome", list(RunOutcome))
def test_the_exit_code_says_how_it_ended(outcome):
    special = {
        "completed": ExitCode.OK,
        "completed_with_losses": ExitCode.SOME_FAILED,
        "unknown": ExitCode.UNKNOWN,
    }
    code = follow(Out(), Run(state("ended", outcome=outcome.value)))
    assert code is special.get(outcome.value, ExitCode.ENDED)


def test_a_run_that_is_not_heard_of_any_more_has_an_unknown_outcome():
    out = Out()
    assert follow(out, Run(state(), then=TimedOut("the edge does not answer"))) is ExitCode.UNKNOWN
    assert out.notes[-1] == "the edge does not answer"
    assert out.documents == [{"run": "3f2a", "outcome": "unknown"}]


def test_who_interrupts_the_command_is_told_that_the_run_goes_on():
    out = Out()
    assert follow(out, Run(state(), then=KeyboardInterrupt())) is ExitCode.INTERRUPTED
    assert out.notes[-1] == ("run 3f2a goes on without this command; end it with: fleet mission abort 3f2a")
    assert out.documents == []
