"""A mission within a mission: how it begins, fails for its robots alone, and ends with the run around it."""

import pytest

from fleet.missions.program import Act, Enter, Leave, Require, Wait
from fleet.missions.state import (
    Abort,
    Facts,
    Hold,
    Left,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    Resume,
    RunOutcome,
)
from tests.fleet.missions.conftest import do

LAND = (Act("command", "land", timeout=60.0),)
PLAYS = {"beast": {"in.a": 0, "in.all": 0}, "rover": {"in.b": 0, "in.all": 0}}


def inner(*steps, then="continue", quorum=None, deadline=None, failed_do="hold"):
    """Return a mission that the role feet carries out, then a step of everybody."""
    enter = Enter("in", "scan", "in.all", len(steps) + 2, quorum or {"in.a": 1}, deadline, failed_do, then)
    return enter, *steps, Leave(0, "in"), do("home", acts={"all": LAND})


@pytest.fixture
def run(play):
    def run(*steps, quorum=None, **options):
        more = {key: options.pop(key) for key in ("on_failure", "require") if key in options}
        return play(*inner(*steps, **options), plays=PLAYS, quorum=quorum or {"eye": 1}, **more)

    return run


def go(step="in.go", role="in.all", **options):
    return do(step, acts={role: (Act("goto", [1, 1], timeout=60.0),)}, **options)


def test_only_its_robots_carry_it_out_and_then_the_run_goes_on(run):
    found = run(go(), go("in.on", "in.a"))
    assert found.begun() == [("beast", "goto"), ("rover", "goto")]
    found.reply("beast").reply("rover")
    assert found.begun()[2:] == [("beast", "goto")]
    found.reply("beast")
    assert [robot for robot, words in found.begun() if words == "land"] == ["kestrel", "beast", "rover"]
    for robot in ("kestrel", "beast", "rover"):
        found.reply(robot)
    assert found.ended is RunOutcome.COMPLETED


def test_a_robot_that_it_can_do_without_is_lost_alone(run):
    found = run(go())
    found.reply("rover", PartOutcome.FAILED, "its motor stalls").stands("rover").reply("beast")
    assert found.begun()[-2:] == [("kestrel", "land"), ("beast", "land")]


def test_when_it_fails_its_robots_have_failed_and_the_others_go_on(run):
    found = run(go(), go("in.on"))
    found.reply("beast", PartOutcome.FAILED, "its motor stalls")
    assert found.outcomes() == {"kestrel": None, "beast": "failed", "rover": "failed"}
    assert ("kestrel", "land") not in found.begun(), "nobody goes on before they stand"
    found.stands("beast", "rover")
    assert found.begun()[-1] == ("kestrel", "land")
    found.reply("kestrel")
    assert found.ended is RunOutcome.WITH_LOSSES
    assert "mission scan failed: beast: failed: its motor stalls; role in.a has 0 of the 1" in (
        found.engine.robots.members["rover"].reason
    )


def test_what_the_step_that_carries_it_says_of_failed_robots_is_done(run):
    found = run(go(), failed_do="land")
    found.take(Left("beast", PartOutcome.LOST, "no heartbeat"))
    assert found.begun()[-1] == ("rover", "land")


def test_a_person_is_asked_whether_to_go_on_without_it(run):
    found = run(go(), then="wait")
    found.reply("beast", PartOutcome.FAILED, "no").stands("beast", "rover")
    assert found.engine.head.phase is Phase.ASKING
    assert "Continue without it?" in found.engine.head.question.text
    found.take(PersonAnswer(1, goes_on=True, by="anna"))
    assert found.begun()[-1] == ("kestrel", "land")


@pytest.mark.parametrize("options", [{"then": "fail"}, {"quorum": {"feet": 1}}])
def test_the_run_fails_with_it_where_it_cannot_do_without_its_robots(run, options):
    outer = {"quorum": options["quorum"]} if "quorum" in options else {}
    found = run(go(undo={"in.all": LAND}), on_failure="undo", then=options.get("then", "continue"), **outer)
    found.reply("beast", PartOutcome.FAILED, "no").stands("beast", "rover", "kestrel")
    assert found.begun()[-2:] == [("beast", "land"), ("rover", "land")], "its steps are undone too"
    found.reply("beast").reply("rover")
    assert found.ended is RunOutcome.UNDONE


def test_its_deadline_ends_it_and_not_the_run(run):
    found = run(Wait("in.rest", 100.0), deadline=30.0)
    found.wait(31.0).stands("beast", "rover")
    assert found.begun()[-1] == ("kestrel", "land")
    assert "mission scan failed: its deadline of 30 s is over" in found.engine.robots.members["beast"].reason


def test_its_deadline_moves_nobody_while_a_person_has_paused_the_run(run):
    found = run(go(), deadline=30.0)
    found.take(Pause("anna")).wait(40.0)
    assert ("kestrel", "land") not in found.begun()
    found.take(Resume("anna")).wait(0.2).stands("beast", "rover")
    assert found.begun()[-1] == ("kestrel", "land")


def test_it_requires_of_its_robots_what_it_says(run):
    found = run(go(require=Require(battery_min=90.0)))
    assert ("beast", "goto") not in found.begun()
    assert found.outcomes()["beast"] == "refused"


def test_a_run_that_has_lost_its_robots_does_not_begin_it(play):
    steps = inner(go())
    found = play(do("first"), Enter("in", "scan", "in.all", 4, {"in.a": 1}), *steps[1:2], Leave(1, "in"))
    found.engine.robots.members["beast"].plays = {"in.a": 0, "in.all": 0}
    found.take(Left("beast", PartOutcome.LOST, "gone")).reply("kestrel").reply("rover")
    assert found.ended is RunOutcome.WITH_LOSSES
    assert [words for _, words in found.begun()].count("goto") == 3


def test_pause_and_abort_of_the_run_reach_it(run):
    found = run(go())
    found.take(Pause("anna"))
    assert {effect.part.robot for effect in found.effects if type(effect).__name__ == "Hold"} == {
        "beast",
        "rover",
    }
    found.take(Facts("beast", "ok", 80.0, (0.0, 0.0, 0.0))).take(Resume("anna")).take(Abort("anna"))
    found.stands("kestrel", "beast", "rover")
    assert found.ended is RunOutcome.ABORTED


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
    run.take(Left("kestrel", PartOutcome.TAKEN, "a pilot has it"))
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
    run.take(Left("kestrel", PartOutcome.LOST, "gone")).wait(6.0)
    assert run.outcomes()["beast"] is PartOutcome.REFUSED
    assert not doing(run)


def test_who_follows_is_paused_and_goes_on_with_the_run(play):
    run = play(following()).take(Pause("anna"))
    assert sorted((each.part.robot, each.resumes) for each in run.of(Hold)) == [
        ("beast", False),
        ("kestrel", False),
        ("rover", False),
    ]
