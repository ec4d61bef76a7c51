"""A run whose robots begin together: prepared first, recorded, and only then told the instant."""

from fleet.missions.observed import SHOWN_WITHIN
from fleet.missions.report import RunControlRequest
from fleet.missions.store import RunStore

TOGETHER = {
    "version": 1,
    "roles": {"eye": {"from": "kestrel"}, "feet": {"from": "beast"}},
    "steps": [
        {"id": "go", "start": "together", "do": {"all": {"goto": [1, 2]}}},
        {"id": "on", "start": "together", "do": {"all": {"goto": [3, 4]}}},
    ],
}


def test_all_are_prepared_recorded_and_then_begin_at_one_instant(yard):
    yard.start(TOGETHER)
    (start,) = yard.starts
    assert sorted(start.robots) == ["beast", "kestrel"]
    assert yard.robots["kestrel"].names == yard.robots["beast"].names == [], "nobody moves before"
    (kept,) = RunStore(yard.folder).unfinished()
    assert sorted(part.identity for part in kept.parts) == ["3f2a/go.1/beast/1", "3f2a/go.1/kestrel/1"]
    start.instant()
    for robot in ("kestrel", "beast"):
        assert yard.robots[robot].names == ["goto"]
        yard.done(robot, "goto")
    assert len(yard.starts) == 2, "each step is a start of its own"
    yard.starts[1].instant()
    yard.done("kestrel", "goto")
    yard.done("beast", "goto")
    assert yard.last.outcome == "completed"


def test_one_that_cannot_be_prepared_keeps_everybody_standing(yard):
    yard.robots["beast"].refuses["goto"] = "the goal is outside its fence"
    yard.start(TOGETHER)
    assert yard.starts[0].withdrawn
    assert yard.starts[0].robots == []
    assert "beast cannot: the goal is outside its fence; no robot moved" in yard.last.reason or (
        yard.last.phase == "ending"
    )
    for robot in ("kestrel", "beast"):
        yard.done(robot, "stop")
    assert (yard.last.outcome, yard.last.reason) == (
        "failed",
        "step go.1: beast cannot: the goal is outside its fence; no robot moved",
    )


def test_when_the_instant_is_not_taken_nobody_moves_and_nothing_is_undone(yard):
    steps = [{**TOGETHER["steps"][0], "undo": {"all": "land"}}]
    yard.start({**TOGETHER, "steps": steps, "on_failure": "undo"})
    yard.starts[0].fail("beast: its process did not take the instant in time")
    yard.settle()
    for robot in ("kestrel", "beast"):
        yard.done(robot, "stop")
    assert yard.last.outcome == "undone"
    assert "did not take the instant in time; no robot moved" in yard.last.reason
    assert yard.robots["kestrel"].names == ["stop"], "there is nothing to undo"


def test_an_abort_before_the_instant_takes_the_start_back(yard):
    yard.start(TOGETHER)
    yard.control("3f2a", RunControlRequest("abort"))
    yard.settle()
    assert yard.starts[0].withdrawn


def test_a_pause_before_all_have_begun_is_refused_in_words_and_changes_nothing(yard):
    yard.start(TOGETHER)
    for _ in range(2):
        why = yard.control("3f2a", RunControlRequest("pause"))
        yard.turn()
        assert why == "its robots are about to begin together: pause it once they have, or abort it now"
    (start,) = yard.starts
    assert not start.withdrawn
    start.instant()
    answers = yard.controlled("3f2a", RunControlRequest("pause"))
    assert yard.last.phase == "paused"
    assert answers == []
    for robot in ("kestrel", "beast"):
        yard.done(robot, "pause")
    assert answers == [""], "once all hold"
    for robot in ("kestrel", "beast"):
        assert yard.robots[robot].names == ["goto", "pause"], "each holds what it has begun"


def test_while_robots_are_asked_whether_they_could_a_pause_is_refused(yard):
    yard.start(TOGETHER, settles=False)
    yard.store._thread.submit(lambda: None).result(20)
    while yard.soon and not yard.starts:
        yard.soon.pop(0)()
    assert yard.control("3f2a", RunControlRequest("pause")).startswith(
        "its robots are about to begin together"
    )


def test_one_that_is_lost_before_it_has_begun_keeps_nobody_from_pausing_the_others(yard):
    yard.start({**TOGETHER, "quorum": {"eye": 1, "feet": 0}})
    yard.starts[0].robots.remove("beast")
    yard.starts[0].instant()
    assert yard.control("3f2a", RunControlRequest("pause"))
    yard.robots["beast"].be(reachable=False, cause="its link fell")
    yard.turn()
    yard.controlled("3f2a", RunControlRequest("pause"))
    assert yard.last.phase == "paused"


def test_a_robot_whose_state_does_not_say_yet_that_it_has_joined_is_not_lost(yard):
    yard.robots["kestrel"].be(left_run="taken: by anna")  # of an earlier run
    yard.robots["kestrel"].shows = False
    yard.start()
    yard.turn()
    assert yard.last.outcome == ""
    assert {robot.robot: robot.outcome for robot in yard.last.robots} == {"kestrel": "", "beast": ""}
    yard.turn(SHOWN_WITHIN)
    assert {robot.robot: robot.outcome for robot in yard.last.robots}["kestrel"] == "taken"
