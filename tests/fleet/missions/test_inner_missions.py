"""A mission within a mission: how it begins, fails for its robots alone, and ends with the run around it."""

import pytest

from fleet.missions.inner_missions import InnerMissions
from fleet.missions.program import Act, Enter, Leave, Program, Require, Wait
from fleet.missions.run_robots import RunRobots
from fleet.missions.state import (
    Abort,
    Facts,
    Hold,
    Left,
    LogNote,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    Question,
    Resume,
    RunHead,
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
    found.handle(Left("beast", PartOutcome.LOST, "no heartbeat"))
    assert found.begun()[-1] == ("rover", "land")


def test_a_person_is_asked_whether_to_go_on_without_it(run):
    found = run(go(), then="wait")
    found.reply("beast", PartOutcome.FAILED, "no").stands("beast", "rover")
    assert found.engine.head.phase is Phase.ASKING
    assert "Continue without it?" in found.engine.head.question.text
    found.handle(PersonAnswer(1, goes_on=True, by="anna"))
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
    found.handle(Pause("anna")).wait(40.0)
    assert ("kestrel", "land") not in found.begun()
    found.handle(Resume("anna")).wait(0.2).stands("beast", "rover")
    assert found.begun()[-1] == ("kestrel", "land")


def test_it_requires_of_its_robots_what_it_says(run):
    found = run(go(require=Require(battery_min=90.0)))
    assert ("beast", "goto") not in found.begun()
    assert found.outcomes()["beast"] == "refused"


def test_a_run_that_has_lost_its_robots_does_not_begin_it(play):
    steps = inner(go())
    found = play(do("first"), Enter("in", "scan", "in.all", 4, {"in.a": 1}), *steps[1:2], Leave(1, "in"))
    found.engine.robots.members["beast"].plays = {"in.a": 0, "in.all": 0}
    found.handle(Left("beast", PartOutcome.LOST, "gone")).reply("kestrel").reply("rover")
    assert found.ended is RunOutcome.WITH_LOSSES
    assert [words for _, words in found.begun()].count("goto") == 3


def test_pause_and_abort_of_the_run_reach_it(run):
    found = run(go())
    found.handle(Pause("anna"))
    assert {effect.part.robot for effect in found.of(Hold)} == {"beast", "rover"}
    found.handle(Facts("beast", "ok", 80.0, (0.0, 0.0, 0.0))).handle(Resume("anna")).handle(Abort("anna"))
    found.stands("kestrel", "beast", "rover")
    assert found.ended is RunOutcome.ABORTED


NESTED = (
    Wait("rest", 5.0),
    Enter("out", "patrol", "out.all", 7, {}, deadline=100.0),
    do("out.go"),
    Enter("out.in", "scan", "out.in.all", 6, {}, deadline=50.0),
    do("out.in.go"),
    Leave(3, "out.in"),
    Leave(1, "out"),
    do("home"),
)


@pytest.fixture
def nested():
    """Return the missions of a run at an index, with its position and its robots."""

    def nested(at, phase=Phase.STEP, **head):
        head = RunHead(phase, at=at, **head)
        robots = RunRobots("run", [])
        return InnerMissions(Program("day", NESTED, {}), head, robots), head, robots

    return nested


@pytest.mark.parametrize(
    ("at", "expected"),
    [(0, []), (1, []), (2, [1]), (3, [1]), (4, [1, 3]), (5, [1]), (6, []), (7, []), (8, [])],
)
def test_a_mission_is_under_way_between_its_first_instruction_and_its_last(nested, at, expected):
    missions, _, _ = nested(at)
    assert [index for index, _ in missions.under_way()] == expected
    assert all(step is NESTED[index] for index, step in missions.under_way())


def test_its_begin_and_its_completion_are_told_with_its_name(nested):
    missions, head, robots = nested(3)
    missions.enter(NESTED[3], 12.5)
    assert head.entered == {"3": 12.5}
    missions.leave(NESTED[5])
    assert head.entered == {}
    assert robots.effects == [
        LogNote("The mission scan begins", step="out.in"),
        LogNote("The mission scan is completed", step="out.in"),
    ]


def test_one_that_failed_is_not_said_to_be_completed(nested):
    missions, _, robots = nested(5)
    missions.leave(NESTED[5])
    assert robots.effects == []


@pytest.mark.parametrize(
    ("now", "late"), [(109.9, None), (110.0, 1), (159.9, 1)], ids=["before", "at once", "the outermost first"]
)
def test_it_is_late_once_its_deadline_has_passed_since_its_begin(nested, now, late):
    missions, _, _ = nested(4, entered={"1": 10.0, "3": 110.0})
    found = missions.late(now)
    assert (found and found[0]) == late
    assert found is None or found[1] is NESTED[late]


def test_one_within_another_may_be_late_alone(nested):
    missions, _, _ = nested(4, entered={"1": 10.0, "3": 20.0})
    assert missions.late(69.9) is None
    assert missions.late(70.0) == (3, NESTED[3])


def test_one_without_a_deadline_is_never_late():
    steps = Enter("in", "scan", "in.all", 3, {}), do("in.go"), Leave(0, "in")
    head = RunHead(Phase.STEP, at=1, entered={"0": 0.0})
    assert InnerMissions(Program("day", steps, {}), head, RunRobots("run", [])).late(1e6) is None


def test_one_whose_begin_is_not_recorded_begins_now(nested):
    missions, _, _ = nested(4, entered={})
    assert missions.late(1e6) is None


@pytest.mark.parametrize("phase", list(Phase))
def test_none_is_late_while_the_run_is_paused_or_ends(nested, phase):
    missions, _, _ = nested(2, phase, entered={"1": 0.0})
    ends = (Phase.PAUSED, Phase.HALTING, Phase.UNDOING, Phase.ENDING, Phase.ENDED)
    assert (missions.late(1000.0) is None) == (phase in ends)


@pytest.mark.parametrize(
    ("about", "is_late"), [("restart", False), ("resume", False), ("robot", True), ("step", True)]
)
def test_none_is_late_while_a_person_decides_whether_the_run_goes_on(nested, about, is_late):
    question = Question(1, "Go on?", 600.0, "abort", about)
    missions, _, _ = nested(2, Phase.ASKING, entered={"1": 0.0}, question=question)
    assert (missions.late(1000.0) is not None) == is_late


def test_a_failed_one_is_left_at_its_end_with_those_within_it(nested):
    question = Question(1, "Continue without it?", 600.0, "abort", "robot")
    missions, head, _ = nested(4, Phase.ASKING, serial=9, entered={"1": 0.0, "3": 1.0}, question=question)
    missions.skip_to_end(1, NESTED[1])
    assert (head.at, head.serial, head.phase) == (6, 10, Phase.STEP), "its end is a step of its own"
    assert (head.entered, head.question) == ({}, None)


def test_the_one_around_a_failed_one_stays_under_way(nested):
    missions, head, _ = nested(4, entered={"1": 0.0, "3": 1.0})
    missions.skip_to_end(3, NESTED[3])
    assert (head.at, head.entered) == (5, {"1": 0.0})
    assert [index for index, _ in missions.under_way()] == [1]


def test_a_paused_run_stays_paused_when_one_fails_and_goes_on_behind_it(nested):
    missions, head, _ = nested(4, Phase.PAUSED, paused_from=Phase.WAITING)
    missions.skip_to_end(1, NESTED[1])
    assert (head.phase, head.paused_from) == (Phase.PAUSED, Phase.STEP)


@pytest.mark.parametrize(("about", "phase"), [("restart", Phase.ASKING), ("resume", Phase.PAUSED)])
def test_a_question_whether_the_run_goes_on_outlives_a_failed_one(nested, about, phase):
    question = Question(1, "Go on?", 600.0, "abort", about)
    missions, head, _ = nested(4, phase, paused_from=Phase.WAITING, question=question)
    missions.skip_to_end(1, NESTED[1])
    assert (head.question, head.phase, head.paused_from) == (question, phase, Phase.STEP)
    assert head.at == 6
