"""One run, event by event: what is taken, what is late, what is tried again, and what follows a restart."""

import pytest

from fleet.missions.engine import Engine
from fleet.missions.program import Act, Ask, Condition, Program, Wait, WaitFor
from fleet.missions.state import (
    Abort,
    Begin,
    Facts,
    Left,
    LogNote,
    Occupy,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    PlaceOccupied,
    Replied,
    Restarted,
    Resume,
    RobotEvent,
    RunMember,
    RunOutcome,
    Start,
    StopAll,
    Tick,
)
from tests.fleet.missions.conftest import do

EVERYBODY = ("kestrel", "beast", "rover")


def again(retry, verb="goto"):
    return do(acts={"eye": (Act(verb, [1, 1], timeout=60.0, retry=retry),)})


def texts(run):
    return [each.text for each in run.of(LogNote)]


def test_effects_and_changes_are_given_once():
    engine = Engine("run", Program("patrol", (again(0),), {}), [RunMember("kestrel", "eye", 0)])
    engine.handle(Facts("kestrel"), 0.0)
    effects = engine.handle(Start(), 0.0)
    assert [each.part.identity for each in effects if isinstance(each, Begin)] == ["run/go.1/kestrel/1"]
    assert engine.handle(Tick(), 0.1) == []
    assert [each.identity for each in engine.changes()] == ["run/go.1/kestrel/1"]
    assert engine.changes() == []


def test_a_run_starts_once(play):
    run = play(do())
    assert len(run.handle(Start()).begun()) == 3


def test_a_run_with_places_begins_once_it_has_them(play):
    run = play(do(), occupies=("gate",))
    assert (run.of(Occupy), run.begun()) == ([Occupy()], [])
    run.handle(PlaceOccupied("gate, which run 7 has"))
    assert run.engine.head.waits_for == "gate, which run 7 has"
    assert texts(run)[-1] == "The run waits for gate, which run 7 has"
    run.handle(PlaceOccupied())
    assert (run.engine.head.waits_for, len(run.begun())) == ("", 3)
    run.handle(PlaceOccupied(late="too late"))
    assert run.engine.head.phase is Phase.STEP, "only while it waits for them"


def test_a_part_is_late_at_its_limit_and_not_before(play):
    run = play(do(), quorum={})
    run.wait(59.9)
    assert run.outcomes() == dict.fromkeys(EVERYBODY)
    run.wait(0.2)
    assert run.outcomes() == dict.fromkeys(EVERYBODY, PartOutcome.LATE)
    assert run.engine.robots.members["beast"].reason == (
        "not seen done within 60 s; seen: ok, idle, at 0.0 0.0 0.0"
    )


def test_progress_extends_the_limit_and_standing_still_does_not(play):
    run = play(do(), quorum={})
    for progress in ("goto 10 %", "goto 20 %"):
        run.wait(50.0).handle(Facts("beast", "ok", 80.0, None, progress)).handle(
            Facts("rover", progress="goto 5 %")
        )
    run.wait(10.0)
    assert run.outcomes() == {"kestrel": "late", "beast": None, "rover": "late"}
    run.handle(Facts("beast", progress="")).wait(49.0)
    assert run.outcomes()["beast"] is None
    run.wait(1.1)
    assert run.outcomes()["beast"] is PartOutcome.LATE


def test_the_first_facts_of_a_robot_are_no_progress_of_it():
    engine = Engine("run", Program("patrol", (do(require=None),), {}), [RunMember("kestrel", "eye", 0)])
    engine.robots.begin("go.1", "kestrel", Act("goto", [1, 1], timeout=60.0), "do", 0.0)
    engine.handle(Facts("kestrel", progress="goto 1 %"), 50.0)
    assert engine.robots.active()[0].until == 60.0
    engine.handle(Facts("kestrel", progress="goto 2 %"), 50.0)
    assert engine.robots.active()[0].until == 110.0


@pytest.mark.parametrize("outcome", list(PartOutcome))
def test_only_what_failed_or_was_refused_is_tried_again(play, outcome):
    run = play(again(1), quorum={}).reply("kestrel", outcome)
    retried = outcome in (PartOutcome.FAILED, PartOutcome.REFUSED)
    begun = [each.part.identity for each in run.of(Begin) if each.part.kind == "do"]
    assert begun == ["run/go.1/kestrel/1", *(["run/go.1/kestrel/2"] if retried else [])]


@pytest.mark.parametrize("retry", [0, 1, 3])
def test_it_is_tried_again_as_often_as_said_and_then_the_robot_has_failed(play, retry):
    run = play(again(retry), quorum={})
    for _ in range(retry):
        run.reply("kestrel", PartOutcome.FAILED, "it slips")
        assert run.outcomes()["kestrel"] is None
    run.reply("kestrel", PartOutcome.FAILED, "it slips")
    assert run.outcomes()["kestrel"] is PartOutcome.FAILED
    assert [words for _, words in run.begun()].count("goto") == retry + 1


def test_nothing_is_tried_again_while_the_run_is_paused(play):
    run = play(again(3), quorum={}).handle(Pause("anna")).reply("kestrel", PartOutcome.FAILED, "it slips")
    assert run.begun() == [("kestrel", "goto"), ("kestrel", "stop")]
    assert run.outcomes()["kestrel"] is PartOutcome.FAILED


def test_a_receipt_an_unknown_identity_and_a_second_answer_change_nothing(play):
    run = play(do(), quorum={})
    part = run.engine.robots.active()[0]
    run.handle(Replied(part.identity, None)).handle(Replied("run/go.1/nobody/1", PartOutcome.FAILED, "no"))
    assert part.inflight
    run.handle(Replied(part.identity, PartOutcome.DONE)).handle(
        Replied(part.identity, PartOutcome.FAILED, "no")
    )
    assert (part.outcome, run.outcomes()[part.robot]) == (PartOutcome.DONE, None)


def test_the_loss_of_a_stranger_or_of_one_that_is_gone_changes_nothing(play):
    run = play(do(), quorum={}).handle(Left("beast", PartOutcome.LOST, "gone"))
    run.effects.clear()
    run.handle(Left("beast", PartOutcome.TAKEN, "anna")).handle(Left("stranger", PartOutcome.LOST, "gone"))
    assert run.effects == []
    assert run.outcomes()["beast"] is PartOutcome.LOST


def test_the_deadline_ends_the_run_also_while_it_is_paused(play):
    run = play(do(), deadline=100.0, quorum={}).handle(Pause("anna")).wait(99.9)
    assert run.engine.head.phase is Phase.PAUSED
    run.wait(0.2).stands(*EVERYBODY)
    assert (run.ended, run.engine.head.reason) == (RunOutcome.FAILED, "the deadline of 100 s is over")


@pytest.mark.parametrize(
    ("on_timeout", "outcome", "reason"),
    [
        ("continue", None, ""),
        ("abort", RunOutcome.ABORTED, "Go on? abort"),
        ("fail", RunOutcome.FAILED, "Go on? no answer"),
    ],
)
def test_a_question_without_an_answer_is_decided_as_it_says(play, on_timeout, outcome, reason):
    run = play(Ask("sure", "Go on?", 30.0, on_timeout), do()).wait(29.9)
    assert run.engine.head.question is not None
    run.wait(0.2)
    assert f"No answer in time: {on_timeout}" in texts(run)
    assert run.engine.head.question is None
    if outcome is None:
        assert len(run.begun()) == 3
    else:
        run.stands(*EVERYBODY)
        assert (run.ended, run.engine.head.reason) == (outcome, reason)


@pytest.mark.parametrize(
    ("by", "goes_on", "note"),
    [("anna", True, "anna answered: continue"), ("", False, "Somebody answered: abort")],
)
def test_an_answer_is_told_with_who_gave_it(play, by, goes_on, note):
    run = play(Ask("sure", "Go on?", 30.0), do()).handle(PersonAnswer(1, goes_on, by))
    assert note in texts(run)
    assert run.engine.head.phase is (Phase.STEP if goes_on else Phase.ENDING)


@pytest.mark.parametrize("question", [0, 2])
def test_an_answer_to_another_question_is_no_answer(play, question):
    run = play(Ask("sure", "Go on?", 30.0), do())
    run.effects.clear()
    assert run.handle(PersonAnswer(question, goes_on=True)).effects == []
    assert run.engine.head.question is not None
    assert play(do()).handle(PersonAnswer(0, goes_on=False)).engine.head.phase is Phase.STEP


def test_an_event_is_seen_from_the_beginning_of_the_wait_on(play):
    wait = WaitFor("look", Condition("eye", event="person_seen"), 60.0)
    run = play(Wait("rest", 5.0), wait, do())
    run.handle(RobotEvent("kestrel", "person_seen")).wait(6.0).wait(1.0)
    assert run.begun() == []
    run.handle(RobotEvent("kestrel", "person_seen")).wait(0.2)
    assert len(run.begun()) == 3


def test_a_stop_of_several_takes_those_of_the_run_and_halts_the_others(play):
    run = play(do()).handle(StopAll(("beast", "stranger"), "anna"))
    assert run.outcomes() == {"kestrel": None, "beast": "stopped", "rover": None}
    assert run.begun()[3:] == [("kestrel", "stop"), ("rover", "stop")]
    assert run.engine.head.reason == "emergency stop: anna"


def test_after_the_end_no_event_has_an_effect(play):
    run = play(do()).handle(StopAll(EVERYBODY, "anna"))
    assert run.engine.over
    run.effects.clear()
    for event in (
        Start(),
        Restarted(),
        Tick(),
        Abort(),
        Pause(),
        Resume(),
        Left("beast", PartOutcome.LOST, ""),
    ):
        run.handle(event)
    assert run.effects == []


def test_a_halt_that_nobody_sees_done_is_given_up_and_the_run_ends(play):
    run = play(do()).handle(Abort("anna")).stands("kestrel", "beast").wait(15.1)
    (halt,) = [part for part in run.engine.robots.parts.values() if part.outcome is PartOutcome.UNKNOWN]
    assert (halt.robot, halt.kind, run.ended) == ("rover", "halt", RunOutcome.ABORTED)


def test_an_undo_that_is_not_done_in_time_has_failed(play):
    run = play(do(undo={"eye": (Act("goto", [0, 0], timeout=30.0),)}), on_failure="undo")
    run.engine.ending.fail("so it was", 0.0)
    run.handle(Tick()).stands(*EVERYBODY).wait(30.1).stands(*EVERYBODY)
    assert run.ended is RunOutcome.UNDO_FAILED


def test_a_run_that_ends_does_not_wait_for_robots_that_left(play):
    run = play(do()).handle(Abort("anna"))
    for robot in EVERYBODY:
        run.handle(Left(robot, PartOutcome.TAKEN, "a pilot has it"))
    assert run.ended is RunOutcome.ABORTED
