"""A step of robots: who follows another, and until when."""

import pytest

from fleet.missions.program import Act, Wait
from fleet.missions.state import Hold, Left, PartOutcome, Pause, RunOutcome
from tests.fleet.missions.conftest import do

LAND = (Act("command", "land", timeout=60.0),)


def following(finish="all", **options):
    """Return a step in which the drone goes, and those on the ground follow it."""
    acts = {"eye": (Act("goto", [1, 1], timeout=60.0),), "feet": (Act("follow", "eye", {"distance_m": 3.0}),)}
    return do("round", acts=acts, finish=finish, **options)


def doing(run):
    return {part.robot: (part.act.verb, part.act.value) for part in run.engine.robots.active("do")}


@pytest.mark.parametrize("finish", ["all", "any", "eye"])
def test_who_follows_follows_until_the_others_are_through(play, finish):
    run = play(following(finish), do("home", acts={"all": LAND}))
    assert doing(run) == {
        "kestrel": ("goto", [1, 1]),
        "beast": ("follow", "kestrel"),
        "rover": ("follow", "kestrel"),
    }
    run.reply("kestrel")
    assert ("beast", "stop") in run.begun()
    run.stands("beast", "rover")
    assert {part.outcome for part in run.engine.robots.parts_of("round.1")} == {PartOutcome.DONE}
    for robot in ("kestrel", "beast", "rover"):
        run.reply(robot, words="land")
    assert run.ended is RunOutcome.COMPLETED


def test_who_follows_has_failed_when_the_robot_ahead_is_lost(play):
    run = play(following(), quorum={"eye": 0, "feet": 0})
    run.handle(Left("kestrel", PartOutcome.TAKEN, "a pilot has it"))
    outcomes = run.outcomes()
    assert outcomes == {
        "kestrel": PartOutcome.TAKEN,
        "beast": PartOutcome.FAILED,
        "rover": PartOutcome.FAILED,
    }
    assert run.engine.robots.members["beast"].reason == "it followed kestrel, which is out of the run"
    assert ("beast", "stop") in run.begun()
    assert ("kestrel", "stop") not in run.begun(), "it is not ours any more"


def test_a_step_that_says_so_ends_the_run_when_the_robot_ahead_fails(play):
    run = play(following(failed_then="fail"), quorum={"eye": 0, "feet": 0})
    run.reply("kestrel", PartOutcome.FAILED, "the motor stopped").stands("kestrel", "beast", "rover")
    assert run.ended is RunOutcome.FAILED


def test_one_that_cannot_follow_any_more_has_failed_alone(play):
    run = play(following(), quorum={"eye": 1, "feet": 1})
    run.reply("beast", PartOutcome.FAILED, "kestrel has not reported its position for 2.1 s")
    assert run.outcomes() == {"kestrel": None, "beast": PartOutcome.FAILED, "rover": None}
    assert doing(run) == {"kestrel": ("goto", [1, 1]), "rover": ("follow", "kestrel")}


def test_with_nobody_left_to_follow_it_is_not_begun(play):
    run = play(Wait("rest", 5.0), following(), quorum={"eye": 0, "feet": 0})
    run.handle(Left("kestrel", PartOutcome.LOST, "gone")).wait(6.0)
    assert run.outcomes()["beast"] is PartOutcome.REFUSED
    assert not doing(run)


def test_who_follows_is_paused_and_goes_on_with_the_run(play):
    run = play(following()).handle(Pause("anna"))
    assert sorted((each.part.robot, each.resumes) for each in run.of(Hold)) == [
        ("beast", False),
        ("kestrel", False),
        ("rover", False),
    ]
