"""A paused run: who holds, which limits are extended, and when a person is asked before it goes on."""

import pytest

from fleet.missions.facts import MOVED
from fleet.missions.pausing import PAUSABLE
from fleet.missions.program import Act, Ask, Require, Wait
from fleet.missions.state import (
    Abort,
    Facts,
    Hold,
    Left,
    LogNote,
    Occupy,
    PartOutcome,
    Pause,
    PersonAnswer,
    Phase,
    PlaceOccupied,
    Resume,
    RunOutcome,
)
from tests.fleet.missions.conftest import do

EVERYBODY = ["beast", "kestrel", "rover"]


def held(run, *, resumes=False):
    return sorted(each.part.robot for each in run.of(Hold) if each.resumes is resumes)


def notes(run):
    return [(each.text, each.robot, each.step) for each in run.of(LogNote)]


def test_every_robot_holds_and_who_paused_is_told(play):
    run = play(do()).handle(Pause("anna"))
    assert (held(run), run.engine.head.phase) == (EVERYBODY, Phase.PAUSED)
    assert notes(run)[-1] == ("anna paused the run", "", "go.1")
    assert notes(play(do()).handle(Pause()))[-1][0] == "Somebody paused the run"
    assert notes(play(do()).handle(Pause()).handle(Resume()))[-1][0] == "Somebody resumed the run"


@pytest.mark.parametrize("verb", ["command", "goto", "path", "plan"])
def test_only_what_moves_a_robot_along_a_route_is_paused(play, verb):
    run = play(do(acts={"eye": (Act(verb, "takeoff", timeout=60.0),)}))
    run.handle(Pause("anna")).handle(Resume("anna"))
    expected = ["kestrel"] if verb in PAUSABLE else []
    assert (held(run), held(run, resumes=True)) == (expected, expected)


def test_the_position_of_each_robot_is_recorded(play):
    run = play(do()).handle(Facts("beast", "ok", 80.0, (4.0, 5.0, 0.0)))
    run.engine.changes()
    run.handle(Pause("anna"))
    assert run.engine.robots.members["beast"].paused_at == (4.0, 5.0, 0.0)
    assert {member.robot for member in run.engine.changes()} == set(EVERYBODY)


@pytest.mark.parametrize("step", [Wait("rest", 30.0), Ask("sure", "Go on?", 30.0), do()])
def test_a_run_is_paused_and_goes_on_where_it_was(play, step):
    run = play(step, do("home"))
    before = run.engine.head.phase
    run.handle(Pause("anna"))
    assert run.engine.head.phase is Phase.PAUSED
    run.handle(Resume("ben"))
    assert run.engine.head.phase is before
    assert ("ben resumed the run", "", run.engine.steps.name) in notes(run)


def test_a_second_pause_changes_nothing(play):
    run = play(do()).handle(Pause("anna"))
    run.effects.clear()
    run.wait(5.0).handle(Pause("ben"))
    assert run.effects == []
    assert (run.engine.head.paused_at, run.engine.head.paused_from) == (0.0, Phase.STEP)


def test_a_run_that_waits_for_its_places_or_ends_is_not_paused(play):
    run = play(do(), occupies=("gate",)).handle(Pause("anna"))
    assert run.engine.head.phase is Phase.OCCUPYING
    run.handle(PlaceOccupied()).handle(Abort("anna")).handle(Pause("anna"))
    assert (run.engine.head.phase, run.of(Hold)) == (Phase.ENDING, [])


def test_a_resumption_of_a_run_that_is_not_paused_changes_nothing(play):
    run = play(do())
    run.effects.clear()
    assert run.handle(Resume("anna")).effects == []


def test_a_robot_that_cannot_go_on_pauses_the_run_for_the_others(play):
    run = play(do()).handle(Pause(robot="beast", reason="did not go on: the battery is at 12 %"))
    assert held(run) == ["kestrel", "rover"], "it does not move"
    assert notes(run)[-2:] == [
        ("did not go on: the battery is at 12 %", "beast", "go.1"),
        ("The run stays paused for beast", "", "go.1"),
    ]


def test_what_a_robot_says_of_a_pause_is_told_though_the_run_is_paused(play):
    run = play(do()).handle(Pause("anna"))
    run.handle(Pause(robot="beast", reason="did not pause: it slips"))
    assert notes(run)[-1] == ("did not pause: it slips", "beast", "go.1")


def test_a_wait_is_as_much_longer_as_the_pause(play):
    run = play(Wait("rest", 30.0), do())
    run.wait(20.0).handle(Pause("anna")).wait(100.0).handle(Resume("anna"))
    run.wait(9.9)
    assert run.begun() == []
    run.wait(0.2)
    assert len(run.begun()) == 3


def test_a_part_has_as_much_longer_as_the_pause(play):
    run = play(do(), quorum={})
    run.wait(50.0).handle(Pause("anna")).wait(100.0)
    assert run.outcomes()["beast"] is None, "no part is late while the run is paused"
    run.engine.changes()
    run.handle(Resume("anna"))
    assert {part.until for part in run.engine.changes()} == {160.0}, "also on disk"
    run.wait(9.9)
    assert run.outcomes()["beast"] is None
    run.wait(0.2)
    assert run.outcomes()["beast"] is PartOutcome.LATE


def test_a_question_has_as_much_longer_as_the_pause(play):
    run = play(Ask("sure", "Go on?", 30.0), do())
    run.wait(20.0).handle(Pause("anna")).wait(100.0)
    run.handle(PersonAnswer(1, goes_on=True, by="anna"))
    assert run.begun() == [], "a paused run begins nothing"
    run.handle(Resume("anna")).wait(9.9)
    assert (run.engine.head.phase, run.engine.head.question.text) == (Phase.ASKING, "Go on?")
    run.handle(PersonAnswer(1, goes_on=True, by="anna"))
    assert len(run.begun()) == 3


def test_the_deadline_of_the_run_is_not_extended(play):
    run = play(do(), deadline=100.0).handle(Pause("anna")).wait(101.0)
    assert run.engine.head.phase is Phase.ENDING


def test_a_robot_that_has_moved_is_told_before_the_run_goes_on(play):
    run = play(do()).handle(Pause("anna")).handle(Facts("beast", "ok", 80.0, (MOVED + 1, 0.0, 0.0)))
    run.wait(10.0).handle(Resume("anna"))
    question = run.engine.head.question
    assert question.text == "beast: it is 4.0 m from where it was left. Resume anyway?"
    assert (question.about, question.until) == ("resume", 610.0)
    assert (run.engine.head.phase, held(run, resumes=True)) == (Phase.PAUSED, [])
    run.handle(PersonAnswer(1, goes_on=True, by="ben"))
    assert (run.engine.head.phase, run.engine.head.question) == (Phase.STEP, None)
    assert held(run, resumes=True) == EVERYBODY


def test_who_resumes_again_is_asked_again_until_the_robot_is_where_it_was(play):
    run = play(do()).handle(Pause("anna")).handle(Facts("beast", position=(9.0, 0.0, 0.0)))
    run.handle(Resume("anna")).handle(Resume("anna"))
    assert (run.engine.head.phase, run.engine.head.question.id) == (Phase.PAUSED, 2)
    run.handle(Facts("beast", position=(1.0, 0.0, 0.0))).handle(Resume("anna"))
    assert (run.engine.head.phase, run.engine.head.question) == (Phase.STEP, None)


def test_a_run_that_asks_something_else_already_asks_nothing_more(play):
    run = play(Ask("sure", "Go on?", 30.0), do()).handle(Pause("anna"))
    run.handle(Facts("beast", position=(9.0, 0.0, 0.0))).handle(Resume("anna"))
    assert (run.engine.head.phase, run.engine.head.question.text) == (Phase.ASKING, "Go on?")


def test_a_robot_that_lacks_what_is_required_is_told_before_it_has_moved(play):
    run = play(do(), require=Require(battery_min=50)).handle(Pause("anna"))
    run.handle(Facts("rover", "ok", 40.0, (50.0, 0.0, 0.0))).handle(Resume("anna"))
    assert run.engine.head.question.text == (
        "rover: its battery is at 40 %, 50 % is required. Resume anyway?"
    )


def test_who_says_no_ends_the_run(play):
    run = play(do()).handle(Pause("anna")).handle(Facts("beast", "fault")).handle(Resume("anna"))
    run.handle(PersonAnswer(1, goes_on=False, by="ben")).stands(*EVERYBODY)
    assert run.ended is RunOutcome.ABORTED
    assert run.engine.head.reason.endswith("Resume anyway? abort by ben")


def test_a_robot_that_is_out_of_the_run_keeps_nobody_from_going_on(play):
    run = play(do()).handle(Pause("anna"))
    run.handle(Left("beast", PartOutcome.TAKEN, "ben")).handle(Facts("beast", "fault", 0.0, (99.0, 0.0, 0.0)))
    run.handle(Resume("anna"))
    assert (run.engine.head.phase, held(run, resumes=True)) == (Phase.STEP, ["kestrel", "rover"])


def test_a_step_that_has_ended_in_the_pause_is_followed_by_the_next(play):
    run = play(do(), do("home")).handle(Pause("anna"))
    for robot in EVERYBODY:
        run.reply(robot)
    assert len(run.begun()) == 3, "not before it goes on"
    run.handle(Resume("anna"))
    assert len(run.begun()) == 6


@pytest.mark.parametrize(
    ("phase", "begins"), [(Phase.NEW, True), (Phase.FILLING, True), (Phase.PREPARING, True)]
)
def test_a_run_that_was_cut_off_between_steps_begins_the_next(play, phase, begins):
    run = play(Wait("rest", 30.0), do())
    head = run.engine.head
    head.phase, head.paused_from, head.at = Phase.PAUSED, phase, 1
    run.handle(Resume("anna"))
    assert (len(run.begun()) == 3) is begins


def test_a_run_that_waited_for_its_places_asks_for_them_again(play):
    run = play(do(), occupies=("gate",))
    head = run.engine.head
    head.phase, head.paused_from = Phase.PAUSED, Phase.OCCUPYING
    run.effects.clear()
    run.handle(Resume("anna"))
    assert run.of(Occupy) == [Occupy()]
    assert run.begun() == []
