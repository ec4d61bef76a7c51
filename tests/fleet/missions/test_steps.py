"""A mission within a mission: how it begins, fails for its robots alone, and ends with the run around it."""

import pytest

from fleet.missions.program import Act, Enter, Leave, Require, Wait
from fleet.missions.state import Abort, Answer, Facts, Left, Outcome, Pause, Phase, Resume, RunOutcome
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
    found.reply("rover", Outcome.FAILED, "its motor stalls").stands("rover").reply("beast")
    assert found.begun()[-2:] == [("kestrel", "land"), ("beast", "land")]


def test_when_it_fails_its_robots_have_failed_and_the_others_go_on(run):
    found = run(go(), go("in.on"))
    found.reply("beast", Outcome.FAILED, "its motor stalls")
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
    found.take(Left("beast", Outcome.LOST, "no heartbeat"))
    assert found.begun()[-1] == ("rover", "land")


def test_a_person_is_asked_whether_to_go_on_without_it(run):
    found = run(go(), then="wait")
    found.reply("beast", Outcome.FAILED, "no").stands("beast", "rover")
    assert found.engine.head.phase is Phase.ASKING
    assert "Go on without it?" in found.engine.head.question.text
    found.take(Answer(1, goes_on=True, by="anna"))
    assert found.begun()[-1] == ("kestrel", "land")


@pytest.mark.parametrize("options", [{"then": "fail"}, {"quorum": {"feet": 1}}])
def test_the_run_fails_with_it_where_it_cannot_do_without_its_robots(run, options):
    outer = {"quorum": options["quorum"]} if "quorum" in options else {}
    found = run(go(undo={"in.all": LAND}), on_failure="undo", then=options.get("then", "continue"), **outer)
    found.reply("beast", Outcome.FAILED, "no").stands("beast", "rover", "kestrel")
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
    found.take(Left("beast", Outcome.LOST, "gone")).reply("kestrel").reply("rover")
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
