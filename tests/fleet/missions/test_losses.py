"""A robot is out of a run: it is made safe, and the run goes on, asks a person, or fails."""

import pytest

from fleet.missions.losses import ANSWERED_WITHIN
from fleet.missions.program import Act, Ask, Condition, Enter, Leave, Require, Wait, WaitFor
from fleet.missions.state import (
    Abort,
    EmergencyStop,
    Facts,
    Left,
    LogNote,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    Resume,
    RobotPrepared,
    RunOutcome,
)
from tests.fleet.missions.conftest import do

EVERYBODY = ("kestrel", "beast", "rover")
NOT_OURS = [PartOutcome.LOST, PartOutcome.TAKEN, PartOutcome.STOPPED]


def lost(robot, reason="no heartbeat", outcome=PartOutcome.LOST):
    return Left(robot, outcome, reason)


@pytest.mark.parametrize("how", ["hold", "land"])
def test_a_robot_that_fails_in_a_step_does_what_the_step_says_of_failed_robots(play, how):
    run = play(do(failed_do=how))
    run.reply("beast", PartOutcome.FAILED, "its motor stalls")
    assert run.begun()[3:] == [("beast", "stop" if how == "hold" else "land")]
    (part,) = [part for part in run.engine.robots.active() if part.robot == "beast"]
    assert (part.kind, part.step) == ("halt" if how == "hold" else "secure", "go.1")


def test_a_robot_that_fails_between_steps_is_halted(play):
    run = play(Wait("rest", 30.0), do()).handle(lost("beast", "its motor stalls", PartOutcome.FAILED))
    assert run.begun() == [("beast", "stop")]
    assert run.engine.head.phase is Phase.WAITING


@pytest.mark.parametrize("outcome", NOT_OURS)
@pytest.mark.parametrize("how", ["hold", "land"])
def test_a_robot_that_is_no_longer_ours_is_not_commanded(play, outcome, how):
    run = play(do(failed_do=how)).handle(lost("beast", outcome=outcome))
    assert run.begun()[3:] == []
    assert run.outcomes()["beast"] is outcome


def test_a_robot_is_lost_once(play):
    run = play(do(failed_then="wait"))
    run.reply("beast", PartOutcome.FAILED, "its motor stalls")
    run.handle(lost("beast"))
    assert run.engine.head.questions == 1
    assert run.engine.robots.members["beast"].outcome is PartOutcome.FAILED
    assert run.engine.robots.members["beast"].reason == "its motor stalls"


def test_a_loss_while_the_run_ends_changes_nothing_of_its_end(play):
    run = play(do(failed_do="land", failed_then="wait")).handle(Abort("anna"))
    run.handle(lost("beast", "its motor stalls", PartOutcome.FAILED))
    assert run.begun()[3:] == [("kestrel", "stop"), ("beast", "stop"), ("rover", "stop")]
    assert run.engine.head.question is None
    assert run.engine.head.reason == "aborted by anna"


def test_who_follows_one_that_follows_the_lost_robot_has_failed_too(play):
    acts = {
        "eye": (Act("goto", [1, 1], timeout=60.0),),
        "feet": (Act("follow", "lead"),),
        "lead": (Act("follow", "eye"),),
    }
    robots = {"kestrel": "eye", "beast": "lead", "rover": "feet"}
    run = play(do(acts=acts), robots=robots, quorum={})
    run.handle(lost("kestrel"))
    assert run.outcomes() == {"kestrel": "lost", "beast": "failed", "rover": "failed"}
    assert run.engine.robots.members["rover"].reason == "it followed beast, which is out of the run"


def test_who_follows_another_or_goes_to_a_place_of_that_name_stays(play):
    acts = {"eye": (Act("goto", "rover"),), "feet": (Act("follow", "eye"),)}
    run = play(do(acts=acts), quorum={}).handle(lost("rover"))
    assert run.outcomes() == {"kestrel": None, "beast": None, "rover": "lost"}


def test_a_loss_within_the_quorum_lets_the_run_go_on(play):
    run = play(do(), quorum={"feet": 1}).handle(lost("beast"))
    assert run.engine.head.phase is Phase.STEP
    assert run.begun()[3:] == []


def test_a_loss_below_the_quorum_fails_the_run_with_both_reasons(play):
    run = play(do(), quorum={"feet": 2}).handle(lost("beast"))
    assert run.engine.head.reason == (
        "beast: lost: no heartbeat; role feet has 1 of the 2 robots that it needs"
    )
    run.stands("kestrel", "rover")
    assert run.ended is RunOutcome.FAILED


def test_a_spare_may_still_make_up_the_quorum(play):
    run = play(do(), quorum={"feet": 2}, spares={"spot": "feet"}).handle(lost("beast"))
    assert run.engine.head.phase is Phase.STEP


def test_a_step_that_says_so_ends_the_run_at_the_first_loss(play):
    run = play(do(failed_then="fail"), quorum={}).handle(lost("beast"))
    assert run.engine.head.reason == "beast: lost: no heartbeat"
    run.stands("kestrel", "rover")
    assert run.ended is RunOutcome.FAILED


def test_a_step_that_says_so_asks_a_person_who_has_ten_minutes(play):
    run = play(do(failed_then="wait"), quorum={})
    run.wait(7.0).handle(lost("beast"))
    question = run.engine.head.question
    assert run.engine.head.phase is Phase.ASKING
    assert (question.id, question.text) == (1, "beast: lost: no heartbeat. Continue without it?")
    assert (question.until, question.on_timeout, question.about) == (607.0, "abort", "robot")
    assert run.of(LogNote)[-1] == LogNote(f"A person is asked: {question.text}", step="go.1")
    run.handle(PersonAnswer(1, goes_on=True, by="anna"))
    assert (run.engine.head.phase, run.engine.head.question) == (Phase.STEP, None)


def test_a_robot_that_is_lost_while_the_run_is_paused_is_asked_about_once_it_is_resumed(play):
    run = play(do(failed_then="wait"), quorum={}).handle(Pause("anna")).handle(lost("beast"))
    assert run.engine.head.question.text == "beast: lost: no heartbeat. Continue without it?"
    assert run.handle(PersonAnswer(1, True, "anna")).engine.head.phase is Phase.PAUSED
    assert run.handle(Resume("anna")).engine.head.phase is Phase.ASKING
    assert run.handle(PersonAnswer(1, True, "anna")).engine.head.phase is Phase.STEP


def test_a_run_that_asks_whether_to_resume_asks_nothing_else(play):
    run = play(do(failed_then="wait"), quorum={}).handle(Pause("anna"))
    run.handle(Facts("kestrel", "ok", 80.0, (9.0, 0.0, 0.0))).handle(Resume("anna"))
    assert run.engine.head.question.about == "resume"
    assert run.handle(lost("beast")).engine.head.question.about == "resume"


def test_the_others_begin_together_without_a_robot_that_is_lost_in_preparation(play):
    run = play(do(together=True), quorum={})
    run.handle(RobotPrepared("kestrel")).handle(RobotPrepared("rover"))
    assert run.begun() == []
    run.handle(lost("beast"))
    assert [robot for robot, _ in run.begun()] == ["kestrel", "rover"]


def test_a_robot_that_is_lost_first_is_waited_for_by_nobody(play):
    run = play(do(together=True), quorum={}).handle(lost("beast"))
    run.handle(RobotPrepared("kestrel"))
    assert run.begun() == []
    run.handle(RobotPrepared("rover"))
    assert [robot for robot, _ in run.begun()] == ["kestrel", "rover"]


def test_a_loss_in_preparation_is_asked_about_and_the_others_prepare_again(play):
    run = play(do(together=True, failed_then="wait"), quorum={}).handle(lost("beast"))
    assert run.engine.head.phase is Phase.ASKING
    run.handle(RobotPrepared("kestrel")).handle(RobotPrepared("rover"))
    assert run.begun() == [], "a person has not answered yet"
    run.effects.clear()
    run.handle(PersonAnswer(1, True, "anna"))
    assert run.preparing == ["kestrel", "rover"]


def test_without_an_answer_the_run_is_aborted(play):
    run = play(do(failed_then="wait"), quorum={}).handle(lost("beast"))
    run.reply("kestrel").reply("rover").wait(ANSWERED_WITHIN - 0.1)
    assert run.engine.head.phase is Phase.ASKING
    run.wait(0.2).stands("kestrel", "rover")
    assert run.ended is RunOutcome.ABORTED


def test_a_second_loss_while_a_person_is_asked_asks_no_second_question(play):
    run = play(do(failed_then="wait"), quorum={}).handle(lost("beast")).handle(lost("rover"))
    assert run.engine.head.questions == 1
    assert run.engine.head.question.text.startswith("beast:")


def test_a_question_of_the_mission_is_not_replaced_by_a_loss(play):
    run = play(Ask("sure", "Go on?", 30.0), do(), quorum={}).handle(lost("beast"))
    assert (run.engine.head.question.text, run.engine.head.questions) == ("Go on?", 1)


def test_a_robot_that_lacks_what_a_step_requires_is_halted_and_the_others_begin(play):
    run = play(Wait("rest", 5.0), do(failed_then="wait"), quorum={}, require=Require(battery_min=50))
    run.handle(Facts("beast", "ok", 40.0)).wait(6.0)
    assert run.begun() == [("beast", "stop")], "a person is asked before the others begin"
    run.handle(PersonAnswer(1, goes_on=True))
    assert run.begun()[1:] == [("kestrel", "goto"), ("rover", "goto")]


def test_on_failure_stop_sets_the_emergency_stop_of_those_that_are_still_ours(play):
    run = play(do(failed_then="fail"), quorum={}, on_failure="stop").handle(lost("beast"))
    assert run.of(EmergencyStop) == [EmergencyStop(("kestrel", "rover"), "beast: lost: no heartbeat")]
    assert run.begun()[3:] == []
    assert run.ended is RunOutcome.FAILED


PLAYS = {"beast": {"in.a": 0, "in.all": 0}, "rover": {"in.b": 0, "in.all": 0}}


@pytest.fixture
def inner(play):
    """Return a run in its mission within the mission, which the beast and the rover carry out."""

    def inner(*, quorum=None, outer=None, deadline=None, **options):
        enter = Enter("in", "scan", "in.all", 3, quorum or {}, deadline, **options)
        acts = {"in.all": (Act("goto", [1, 1], timeout=60.0),)}
        steps = enter, do("in.go", acts=acts), Leave(0, "in"), do("home")
        return play(*steps, plays=PLAYS, quorum=outer or {})

    return inner


def test_a_mission_within_the_mission_fails_for_its_robots_with_both_reasons(inner):
    run = inner(quorum={"in.a": 1, "in.b": 1}).handle(lost("beast"))
    assert run.engine.robots.members["rover"].reason == (
        "mission scan failed: beast: lost: no heartbeat; role in.a has 0 of the 1 robots that it needs"
    )
    assert run.engine.robots.members["beast"].reason == "no heartbeat"
    assert run.outcomes()["kestrel"] is None
    assert LogNote(f"The {run.engine.robots.members['rover'].reason}", step="in") in run.of(LogNote)
    assert run.begun()[2:] == [("rover", "stop")]


def test_one_that_is_not_short_of_robots_goes_on(inner):
    run = inner(quorum={"in.a": 1}).handle(lost("rover"))
    assert run.outcomes() == {"kestrel": None, "beast": None, "rover": "lost"}


def test_the_run_fails_before_the_mission_within_it_when_both_are_short(inner):
    run = inner(quorum={"in.a": 1}, outer={"feet": 2}).handle(lost("beast"))
    assert run.engine.head.phase is Phase.ENDING
    assert run.engine.head.reason.endswith("role feet has 1 of the 2 robots that it needs")


@pytest.mark.parametrize(("paused", "how"), [(False, "hold"), (True, "hold"), (False, "land")])
def test_a_late_mission_makes_its_robots_safe_at_its_end(inner, paused, how):
    run = inner(deadline=20.0, failed_do=how)
    if paused:
        run.handle(Pause("anna")).wait(25.0).handle(Resume("anna"))
    run.wait(20.0)
    word = "stop" if how == "hold" else "land"
    assert run.begun()[2:] == [("beast", word), ("rover", word)]
    assert run.engine.head.at == 2
    assert run.engine.robots.members["beast"].reason == ("mission scan failed: its deadline of 20 s is over")


@pytest.mark.parametrize("within", [True, False])
def test_a_condition_that_does_not_occur_fails_the_mission_that_waits_for_it(play, within):
    wait = WaitFor("for", Condition("feet", event="person_seen"), 30.0)
    steps = (Enter("in", "scan", "in.all", 3, {}), wait, Leave(0, "in")) if within else (wait,)
    run = play(*steps, do("home"), plays=PLAYS, quorum={}).wait(31.0)
    if not within:
        assert run.engine.head.reason == "step for.1: its condition did not occur in time"
        return
    assert run.outcomes() == {"kestrel": None, "beast": "failed", "rover": "failed"}
    assert run.engine.robots.members["beast"].reason == (
        "mission scan failed: step for.2: its condition did not occur in time"
    )
    run.stands("beast", "rover")
    assert run.begun()[-1] == ("kestrel", "goto")


def test_the_step_that_carries_a_late_mission_may_end_the_run(inner):
    run = inner(deadline=20.0, failed_then="fail").wait(20.0)
    assert run.engine.head.reason == "mission scan failed: its deadline of 20 s is over"
    run.stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED
