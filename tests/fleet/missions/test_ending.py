"""The end of a run: its robots stand before anything is undone, and the end is reached once."""

import pytest

from fleet.missions.program import Act, Ask, Wait
from fleet.missions.state import (
    Abort,
    EmergencyStop,
    Ended,
    Left,
    LogNote,
    PartOutcome,
    Pause,
    Phase,
    RunOutcome,
    StopAll,
    Tick,
)
from tests.fleet.missions.conftest import do

LAND = {"all": (Act("command", "land", timeout=60.0),)}
TAKEOFF = {"all": (Act("command", "takeoff", timeout=60.0),)}
GRIP = {"feet": (Act("command", "grip", timeout=60.0),)}
EVERYBODY = ("kestrel", "beast", "rover")


def fails(run):
    """Let a step of a run fail."""
    run.engine.ending.fail("so it was", run.now)
    return run.handle(Tick())


def words(run, robot):
    return [each for name, each in run.begun() if name == robot]


def test_a_run_that_fails_ends_once_its_robots_stand(play):
    run = fails(play(do()))
    assert run.begun()[3:] == [(robot, "stop") for robot in EVERYBODY]
    assert {part.outcome for part in run.engine.robots.parts_of("go.1")} == {PartOutcome.SKIPPED}
    assert LogNote("The run is to end as failed: so it was", step="go.1") in run.of(LogNote)
    run.stands("kestrel", "beast")
    assert run.ended is None
    run.stands("rover")
    assert run.of(Ended) == [Ended(RunOutcome.FAILED, "so it was")]
    assert run.outcomes() == dict.fromkeys(EVERYBODY, PartOutcome.SKIPPED)
    assert run.of(LogNote)[-1].text == "The run has ended: failed: so it was"


def test_the_first_reason_of_an_end_is_the_one_that_stays(play):
    run = fails(play(do(), on_abort="land")).handle(Abort("anna"))
    assert words(run, "kestrel") == ["goto", "stop"]
    run.stands(*EVERYBODY)
    assert (run.ended, run.engine.head.reason) == (RunOutcome.FAILED, "so it was")


def test_a_question_is_withdrawn_when_the_run_ends(play):
    run = play(Ask("sure", "Go on?", 30.0)).handle(Abort("anna"))
    assert run.engine.head.question is None


def test_steps_are_undone_in_reverse_once_all_stand_one_at_a_time(play):
    run = play(do("up", acts=TAKEOFF, undo=LAND), do("grip", acts=GRIP, undo=GRIP), do(), on_failure="undo")
    for robot in EVERYBODY:
        run.reply(robot)
    run.reply("beast").reply("rover")
    before = len(run.begun())
    fails(run)
    assert run.engine.head.phase is Phase.HALTING
    run.stands(*EVERYBODY)
    assert run.begun()[before + 3 :] == [("beast", "grip"), ("rover", "grip")]
    run.reply("beast")
    assert run.begun()[before + 5 :] == [], "the step before waits for both"
    run.reply("rover")
    assert run.begun()[before + 5 :] == [(robot, "land") for robot in EVERYBODY]
    for robot in EVERYBODY:
        run.reply(robot)
    assert run.ended is RunOutcome.UNDONE


def test_only_those_that_had_started_a_step_undo_it(play):
    run = play(do("grip", acts=GRIP, undo=LAND), on_failure="undo")
    fails(run).stands(*EVERYBODY)
    assert run.begun()[-2:] == [("beast", "land"), ("rover", "land")]
    assert "land" not in words(run, "kestrel")


def test_a_robot_for_which_nothing_is_said_to_undo_a_step_stands(play):
    run = play(do(undo={"eye": LAND["all"]}), on_failure="undo")
    fails(run).stands(*EVERYBODY)
    assert run.begun()[-1] == ("kestrel", "land")
    assert "land" not in words(run, "beast")


@pytest.mark.parametrize("robot", ["beast", "kestrel"])
def test_a_robot_that_failed_is_undone_as_well_and_one_that_was_lost_is_not(play, robot):
    run = play(do(undo=LAND), on_failure="undo", quorum={})
    run.reply("beast", PartOutcome.FAILED, "no").handle(Left("kestrel", PartOutcome.LOST, "gone"))
    fails(run).stands("beast", "rover")
    assert ("land" in words(run, robot)) is (robot == "beast")


def test_a_run_with_nothing_to_undo_is_undone_at_once(play):
    run = fails(play(Wait("rest", 30.0), on_failure="undo")).stands(*EVERYBODY)
    assert run.ended is RunOutcome.UNDONE
    run = fails(play(do(), on_failure="undo")).stands(*EVERYBODY)
    assert run.ended is RunOutcome.UNDONE, "a step without undo"


def test_an_undo_that_fails_ends_the_undoing_and_the_others_are_halted(play):
    run = play(do("grip", acts=GRIP, undo=GRIP), do("turn", acts=TAKEOFF, undo=TAKEOFF), on_failure="undo")
    run.reply("beast").reply("rover")
    fails(run).stands(*EVERYBODY)
    run.reply("beast", PartOutcome.FAILED, "its motor stalls")
    assert run.begun()[-3:] == [(robot, "stop") for robot in EVERYBODY]
    assert run.engine.head.phase is Phase.ENDING
    run.stands(*EVERYBODY)
    assert run.ended is RunOutcome.UNDO_FAILED
    assert run.engine.head.reason == "so it was; beast could not undo turn.2: its motor stalls"
    assert words(run, "rover").count("grip") == 1, "the step before is not undone"


def test_on_failure_hold_undoes_nothing(play):
    run = fails(play(do(undo=LAND))).stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED
    assert "land" not in words(run, "beast")


def test_on_failure_stop_sets_the_emergency_stop_of_all_and_commands_nobody(play):
    run = play(do(undo=LAND), on_failure="stop")
    before = len(run.begun())
    fails(run)
    assert run.of(EmergencyStop) == [EmergencyStop(EVERYBODY, "so it was")]
    assert run.begun()[before:] == []
    assert (run.ended, run.outcomes()["beast"]) == (RunOutcome.FAILED, PartOutcome.STOPPED)


def test_on_failure_stop_of_nobody_stops_nobody(play):
    run = play(do(), on_failure="stop", quorum={})
    for robot in EVERYBODY:
        run.handle(Left(robot, PartOutcome.LOST, "gone"))
    assert run.of(EmergencyStop) == []


@pytest.mark.parametrize(("on_abort", "word"), [("hold", "stop"), ("land", "land"), ("sit_down", "sit_down")])
def test_an_abort_does_what_the_mission_says(play, on_abort, word):
    run = play(do(), on_abort=on_abort).handle(Abort("anna"))
    assert run.begun()[3:] == [(robot, word) for robot in EVERYBODY]
    for robot in EVERYBODY:
        run.reply(robot)
    assert (run.ended, run.engine.head.reason) == (RunOutcome.ABORTED, "aborted by anna")


def test_an_abort_by_nobody_known_says_so(play):
    assert play(do()).handle(Abort()).engine.head.reason == "aborted by an unknown sender"


def test_who_cannot_do_what_is_said_of_an_abort_is_halted(play):
    run = play(do(), on_abort="sit_down").handle(Abort("anna"))
    run.reply("beast", PartOutcome.REFUSED, "it has a fault").reply("kestrel").reply("rover")
    assert run.begun()[-1] == ("beast", "stop")
    run.stands("beast")
    assert run.ended is RunOutcome.ABORTED


def test_who_does_not_stand_is_told_with_the_outcome(play):
    run = fails(play(do())).stands("kestrel", "rover")
    run.wait(14.9)
    assert run.ended is None
    run.wait(0.2)
    assert run.ended is RunOutcome.FAILED
    assert run.engine.head.reason.startswith(
        "so it was; beast was not seen to stand still: not seen done within 15 s; seen: ok, idle, at 0.0"
    )


@pytest.mark.parametrize("end", ["abort", "fail", "stop"])
def test_a_robot_that_lands_is_left_to_it_and_waited_for(play, end):
    run = play(do(acts=LAND), on_abort="takeoff")
    if end == "abort":
        run.handle(Abort("anna"))
    elif end == "stop":
        run.handle(StopAll((), "anna"))
    else:
        fails(run)
    assert run.begun() == [(robot, "land") for robot in EVERYBODY]
    assert run.ended is None
    run.reply("kestrel").reply("beast").reply("rover")
    assert run.ended is (RunOutcome.FAILED if end == "fail" else RunOutcome.ABORTED)


def test_an_emergency_stop_breaks_off_an_undo_and_an_abort(play):
    run = play(do(undo=TAKEOFF), on_failure="undo")
    fails(run).stands(*EVERYBODY)
    assert run.engine.head.phase is Phase.UNDOING
    run.handle(StopAll(("beast",), "ben"))
    assert words(run, "kestrel") == ["goto", "stop", "takeoff", "stop"]
    assert words(run, "beast") == ["goto", "stop", "takeoff"]
    run.stands("kestrel", "rover")
    assert (run.ended, run.engine.head.reason) == (RunOutcome.ABORTED, "emergency stop: ben")
    run = play(do(), on_abort="takeoff").handle(Abort("anna")).handle(StopAll(("beast",), "ben"))
    assert run.begun()[-2:] == [("kestrel", "stop"), ("rover", "stop")]


def test_a_robot_that_is_being_made_safe_is_not_halted_too(play):
    run = play(do(failed_do="sit_up"), quorum={})
    run.reply("beast", PartOutcome.FAILED, "no")
    fails(run)
    assert words(run, "beast") == ["goto", "sit_up"]
    run.stands("kestrel", "rover").reply("beast")
    assert run.ended is RunOutcome.FAILED


def test_a_run_that_comes_to_its_end_is_completed(play):
    run = play(do())
    for robot in EVERYBODY:
        run.reply(robot)
    assert run.of(Ended) == [Ended(RunOutcome.COMPLETED, "")]
    assert run.outcomes() == dict.fromkeys(EVERYBODY, PartOutcome.DONE)
    assert run.of(LogNote)[-1].text == "The run has ended: completed"


def test_after_its_end_nothing_ends_it_again(play):
    run = fails(play(do())).stands(*EVERYBODY)
    run.effects.clear()
    run.engine.ending.close(RunOutcome.COMPLETED, "")
    run.engine.ending.abort("later", 1.0)
    run.engine.ending.check(1.0)
    run.handle(StopAll(EVERYBODY, "ben")).handle(Pause("anna"))
    assert (run.effects, run.engine.head.outcome) == ([], RunOutcome.FAILED)


def test_a_run_that_is_closed_gives_up_what_is_under_way(play):
    run = play(do())
    run.engine.ending.close(RunOutcome.UNKNOWN, "the edge failed")
    run.handle(Tick())
    parts = run.engine.robots.parts_of("go.1")
    assert {(part.outcome, part.reason) for part in parts} == {(PartOutcome.UNKNOWN, "the run ended")}
    assert run.ended is RunOutcome.UNKNOWN
    assert run.engine.robots.active() == []


def test_a_run_that_is_closed_asks_nothing_more(play):
    run = play(Ask("sure", "Go on?", 30.0))
    run.engine.ending.close(RunOutcome.UNKNOWN, "the edge failed")
    assert run.engine.head.question is None


def test_a_run_whose_robots_were_all_stopped_one_by_one_is_aborted_and_nothing_is_undone(play):
    run = play(do("up", acts=TAKEOFF, undo=LAND), on_failure="undo")
    for robot in EVERYBODY:
        run.handle(Left(robot, PartOutcome.STOPPED, "emergency stop"))
    head = run.engine.head
    assert (head.phase, head.outcome) == (Phase.ENDED, RunOutcome.ABORTED)
    assert head.reason.startswith("emergency stop: ")
    assert not [act for _, act in run.begun() if act == "land"]
    assert set(run.outcomes().values()) == {PartOutcome.STOPPED}
