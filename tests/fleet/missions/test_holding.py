"""A pause and a resumption of a run: who asked hears what the robots answer, and the run is what it says."""

from fleet.missions.holding import ANSWERED_WITHIN
from fleet.missions.report import RunControlRequest
from tests.fleet.missions.yard import MISSION

MOVES = {**MISSION, "steps": [{"id": "go", "do": {"all": {"goto": [1, 2]}}}]}
PAUSE, RESUME = RunControlRequest("pause"), RunControlRequest("resume")
BOTH = ("kestrel", "beast")


def story(yard):
    lines = []
    yard.store.story("3f2a", lines.extend)
    yard.settle()
    return " / ".join(f"{each.robot} {each.text}" for each in lines)


def paused(yard):
    yard.start(MOVES)
    answers = yard.controlled("3f2a", PAUSE)
    for robot in BOTH:
        yard.done(robot, "pause")
    assert answers == [""]


def test_a_resumption_is_answered_once_all_robots_have_taken_it(yard):
    paused(yard)
    assert yard.controlled("3f2a", RESUME) == [""]
    assert yard.last.phase == "step"


def test_a_robot_that_refuses_to_go_on_keeps_the_run_paused_and_the_others_hold_again(yard):
    paused(yard)
    yard.robots["kestrel"].refuses["resume"] = "the battery is at 12 %"
    assert yard.controlled("3f2a", RESUME) == ["kestrel: the battery is at 12 %"]
    assert yard.last.phase == "paused"
    assert yard.robots["beast"].names == ["goto", "pause", "resume", "pause"]
    assert yard.robots["kestrel"].names == ["goto", "pause", "resume"]
    assert "kestrel did not go on: the battery is at 12 %" in story(yard)
    del yard.robots["kestrel"].refuses["resume"]
    yard.done("beast", "pause")
    assert yard.controlled("3f2a", RESUME) == [""]
    assert yard.last.phase == "step"


def test_each_robot_that_refuses_is_named(yard):
    paused(yard)
    for robot in BOTH:
        yard.robots[robot].refuses["resume"] = "it has no position"
    assert yard.controlled("3f2a", RESUME) == ["kestrel: it has no position; beast: it has no position"]
    assert yard.last.phase == "paused"


def test_a_pause_that_a_robot_refuses_is_reported_and_the_others_hold(yard):
    yard.start(MOVES)
    yard.robots["kestrel"].refuses["pause"] = "it does not answer"
    answers = yard.controlled("3f2a", PAUSE)
    assert answers == [], "beast does not hold yet"
    yard.done("beast", "pause")
    assert answers == ["kestrel: it does not answer"]
    assert yard.last.phase == "paused"
    assert "kestrel did not pause: it does not answer" in story(yard)


def test_a_robot_that_has_arrived_meanwhile_refuses_nothing(yard):
    yard.start(MOVES)
    read = yard.robots["kestrel"].read

    def arrives(kind, payload, **more):
        if b"pause" in payload:
            yard.robots["kestrel"].refuses["pause"] = "there is no action to pause"
            yard.robots["kestrel"].done("goto")
        return read(kind, payload, **more)

    yard.robots["kestrel"].read = arrives
    answers = yard.controlled("3f2a", PAUSE)
    yard.done("beast", "pause")
    assert answers == [""]


def test_a_robot_that_does_not_answer_is_reported_in_time(yard):
    yard.start(MOVES)
    answers = yard.controlled("3f2a", PAUSE)
    yard.done("beast", "pause")
    yard.turn(ANSWERED_WITHIN)
    assert answers == [f"kestrel: no answer for {ANSWERED_WITHIN:g} s"]


def test_who_waits_hears_that_the_run_has_ended(yard):
    yard.start(MOVES)
    answers = yard.controlled("3f2a", PAUSE)
    yard.controlled("3f2a", RunControlRequest("abort"))
    for robot in BOTH:
        yard.done(robot, "stop")
    assert yard.last.outcome == "aborted"
    assert answers in (["the run has ended"], [""])
