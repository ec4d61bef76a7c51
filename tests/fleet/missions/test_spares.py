"""A spare takes the place of a robot that is lost, between two steps, when it still can."""

from fleet.missions.state import (
    Dismiss,
    Enlist,
    Enlisted,
    Facts,
    Left,
    PartOutcome,
    Phase,
    RunOutcome,
    StopAll,
)
from tests.fleet.missions.conftest import do

SPARES = {"spot": "feet"}
MISSION = {
    "version": 1,
    "roles": {"feet": {"count": 1, "spares": 1}},
    "steps": [
        {"id": "out", "do": {"feet": {"goto": [1, 2]}}},
        {"id": "back", "do": {"feet": {"goto": [0, 0]}}},
    ],
}


def lost(play, spares=SPARES):
    """Play a run whose beast is lost in the first step, and whose step is over."""
    run = play(do(), do("home"), spares=spares, quorum={"eye": 1, "feet": 2})
    run.handle(Left("beast", PartOutcome.LOST, "no heartbeat"))
    assert run.engine.head.phase is Phase.STEP, "it may still come to its quorum"
    return run.reply("kestrel").reply("rover")


def test_it_is_asked_between_two_steps_and_takes_the_place(play):
    run = lost(play)
    assert [each.robot for each in run.of(Enlist)] == ["spot"]
    assert ("kestrel", "goto") not in run.begun()[3:], "the others wait for it"
    run.handle(Enlisted("spot"))
    assert [robot for robot, _ in run.begun()[3:]] == ["kestrel", "rover", "spot"]
    member = run.engine.robots.members["spot"]
    assert (member.index, member.spare, member.ours) == (
        run.engine.robots.members["beast"].index,
        False,
        True,
    )
    for robot in ("kestrel", "rover", "spot"):
        run.reply(robot)
    assert run.ended is RunOutcome.WITH_LOSSES
    assert run.outcomes() == {"kestrel": "done", "beast": "lost", "rover": "done", "spot": "done"}


def test_one_that_refuses_is_left_alone_and_the_next_is_asked(play):
    run = lost(play, {"spot": "feet", "tank": "feet"})
    run.handle(Enlisted("spot", "it is in run 7"))
    assert [each.robot for each in run.of(Enlist)] == ["spot", "tank"]
    run.handle(Enlisted("tank"))
    assert ("tank", "goto") in run.begun()


def test_without_any_spare_left_the_run_fails(play):
    run = lost(play).handle(Enlisted("spot", "anna has control")).stands("kestrel", "rover")
    assert run.ended is RunOutcome.FAILED
    assert run.engine.head.reason == "role feet has 1 of the 2 robots that it needs"
    assert "spot" not in dict(run.begun())


def test_one_that_does_not_answer_is_not_waited_for_for_ever(play):
    run = lost(play).wait(11.0).stands("kestrel", "rover")
    assert run.ended is RunOutcome.FAILED
    run.effects.clear()
    run.handle(Enlisted("spot"))
    assert run.effects == [], "the run has ended; its runner gives the robot back"


def test_one_that_joins_too_late_is_given_back(play):
    run = lost(play, {"spot": "feet", "tank": "feet"}).wait(11.0)
    run.handle(Enlisted("spot"))
    assert [each.robot for each in run.of(Dismiss)] == ["spot"]
    assert not run.engine.robots.members["spot"].ours


def test_one_that_does_not_have_what_is_required_any_more_is_not_asked(play):
    run = play(do(), do("home"), spares=SPARES, quorum={"eye": 1})
    run.handle(Facts("spot", "fault")).handle(Left("beast", PartOutcome.LOST, "gone")).reply("kestrel").reply(
        "rover"
    )
    assert run.of(Enlist) == []
    assert run.begun()[-2:] == [("kestrel", "goto"), ("rover", "goto")]


def test_a_spare_of_another_role_is_not_asked(play):
    run = play(do(), do("home"), spares={"spot": "feet"}, quorum={"feet": 2})
    run.handle(Left("kestrel", PartOutcome.LOST, "gone")).reply("beast").reply("rover")
    assert run.of(Enlist) == []


def test_one_that_was_not_needed_is_no_loss_and_is_never_commanded(play):
    run = play(do(), spares=SPARES).reply("kestrel").reply("beast").reply("rover")
    assert run.ended is RunOutcome.COMPLETED
    assert "spot" not in dict(run.begun())
    assert play(do(), spares=SPARES).handle(StopAll(("spot",), "anna")).of(Enlist) == []


def test_it_is_shown_at_the_start_stays_free_and_joins_when_it_is_needed(yard):
    ((_, roles, refusal),) = yard.start(MISSION)
    assert (roles, refusal) == ({"feet": ["beast"], "spare feet": ["kestrel"]}, "")
    assert {each.robot: each.doing for each in yard.last.robots} == {"beast": "goto", "kestrel": "spare"}
    assert yard.robots["kestrel"].requests == [], "it is not the run's yet"
    yard.robots["beast"].be(reachable=False, cause="no heartbeat")
    yard.turn()
    yard.turn()
    assert yard.robots["kestrel"].now.run == "3f2a"
    assert yard.robots["kestrel"].names == ["goto"]
    yard.done("kestrel", "goto")
    assert yard.last.outcome == "completed_with_losses"
    assert yard.robots["kestrel"].now.run == ""


def test_one_that_another_run_has_by_then_is_not_taken_from_it(yard):
    yard.start(MISSION)
    yard.robots["kestrel"].refuses["join_run"] = "it is in run 7"
    yard.robots["beast"].be(reachable=False)
    yard.turn()
    yard.turn()
    assert yard.last.outcome == "failed"
    assert yard.robots["kestrel"].names == []
    assert "leave_run" not in [name for name, _ in yard.robots["kestrel"].requests][:1]


def test_a_robot_that_fleet_yaml_has_no_more_is_no_spare(yard):
    yard.start(MISSION)
    yard.begin()
    del yard.robots["kestrel"]
    yard.robots["beast"].be(run="")
    yard.runs.restore_runs()
    yard.turn()
    assert yard.last.question is not None
