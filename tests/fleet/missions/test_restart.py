"""A run that another process takes up: nothing begins twice, and what nobody saw is not said to be done."""

import pytest

from fleet.missions.engine import Engine
from fleet.missions.program import Act, Ask, Wait
from fleet.missions.state import (
    Begin,
    Facts,
    LogNote,
    Occupy,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    Restarted,
    RunHead,
    RunMember,
    RunOutcome,
    Tick,
)
from tests.fleet.missions.conftest import do

EVERYBODY = ("kestrel", "beast", "rover")
TAKEOFF = {"all": (Act("command", "takeoff", timeout=60.0),)}


def texts(run):
    return [each.text for each in run.of(LogNote)]


def fails(run):
    """Let a step of a run fail."""
    run.engine.ending.fail("so it was", run.now)
    return run.handle(Tick())


@pytest.mark.parametrize(
    ("phase", "outcome", "reason"),
    [
        (Phase.HALTING, RunOutcome.UNDO_FAILED, "so it was; the edge restarted while it was undone"),
        (Phase.UNDOING, RunOutcome.UNDO_FAILED, "so it was; the edge restarted while it was undone"),
        (Phase.ENDING, RunOutcome.FAILED, "so it was"),
    ],
)
def test_an_end_that_a_restart_cut_off_is_held_and_undoes_nothing_more(play, phase, outcome, reason):
    run = play(do(undo=TAKEOFF), on_failure="hold" if phase is Phase.ENDING else "undo")
    fails(run)
    if phase is Phase.UNDOING:
        run.stands(*EVERYBODY)
    assert run.engine.head.phase is phase
    before = len(run.begun())
    run.handle(Restarted())
    assert run.begun()[before:] == [(robot, "stop") for robot in EVERYBODY]
    run.stands(*EVERYBODY)
    assert (run.ended, run.engine.head.reason) == (outcome, reason)


@pytest.mark.parametrize("later", [False, True])
def test_a_robot_whose_last_step_nobody_saw_to_its_end_is_not_said_to_have_done_it(play, later):
    run = play(do(), *([do("home")] if later else [])).handle(Restarted())
    run.stands(*EVERYBODY).wait(1.0).handle(PersonAnswer(1, goes_on=True, by="anna"))
    for robot in EVERYBODY if later else ():
        run.reply(robot)
    assert run.ended is (RunOutcome.COMPLETED if later else RunOutcome.WITH_LOSSES)
    unseen = (PartOutcome.UNKNOWN, "the end of step go.1 was not observed")
    expected = (PartOutcome.DONE, "") if later else unseen
    assert {(each.outcome, each.reason) for each in run.engine.robots.members.values()} == {expected}


@pytest.mark.parametrize(
    ("policy", "phase", "about"),
    [
        ("continue", Phase.WAITING, None),
        ("hold_and_ask", Phase.PAUSED, "resume"),
        ("fail", Phase.ENDING, None),
    ],
)
def test_a_restart_between_steps_follows_the_mission(play, policy, phase, about):
    run = play(Wait("rest", 30.0), do(), on_restart=policy).handle(Restarted())
    question = run.engine.head.question
    assert (run.engine.head.phase, question and question.about) == (phase, about)
    assert "The edge restarted; the outcome of active commands is unknown" in texts(run)
    if about:
        assert question.text == "The edge restarted before the end of step rest.1. Resume?"
    if policy == "fail":
        assert run.engine.head.reason == "the edge restarted in step rest.1"


@pytest.mark.parametrize("policy", ["continue", "hold_and_ask"])
@pytest.mark.parametrize("paused", [False, True])
def test_a_restart_within_a_step_halts_and_asks_whatever_the_mission_says(play, policy, paused):
    run = play(do(), do("home"), on_restart=policy)
    if paused:
        run.handle(Pause("anna"))
    run.handle(Restarted())
    assert run.begun()[3:] == [(robot, "stop") for robot in EVERYBODY]
    assert {part.outcome for part in run.engine.robots.parts_of("go.1")} == {PartOutcome.UNKNOWN}
    assert run.engine.head.phase is Phase.ASKING
    assert run.engine.head.question.text == ("The edge restarted in step go.1. Continue with the next step?")
    assert run.engine.head.question.about == "restart"


def test_a_question_that_was_open_stays_open_after_a_restart(play):
    run = play(Ask("sure", "Go on?", 30.0), do())
    before = run.engine.head.question
    run.handle(Restarted())
    assert (run.engine.head.phase, run.engine.head.question) == (Phase.ASKING, before)


@pytest.mark.parametrize(("occupies", "begins"), [((), True), (("gate",), False)])
def test_a_restart_before_the_first_step_begins_it_or_asks_for_the_places_again(play, occupies, begins):
    run = play(do(), occupies=occupies, on_restart="continue")
    head = RunHead(Phase.OCCUPYING if occupies else Phase.NEW)
    engine = Engine(
        "run", run.program, [RunMember("kestrel", "eye", 0), RunMember("rover", "feet", 0)], head=head
    )
    for robot in ("kestrel", "rover"):
        engine.handle(Facts(robot), 0.0)
    effects = engine.handle(Restarted(), 0.0)
    assert any(isinstance(each, Begin) for each in effects) is begins
    assert any(isinstance(each, Occupy) for each in effects) is not begins
