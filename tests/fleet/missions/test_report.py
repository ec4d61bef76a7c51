"""The state of a run as people see it: who does what, what is asked, and how it ended."""

import msgspec

from fleet.missions.program import Act, Ask
from fleet.missions.report import MissionStartRequest, RunRobot, RunState, ended_state, state_of
from fleet.missions.state import PartOutcome, Phase, RunHead, RunMember, RunOutcome, StopAll
from fleet.missions.store import RunOrigin
from tests.fleet.missions.conftest import do

ABOUT = RunOrigin("3f2a", "patrol", "ab12", 1000.0, "anna", "cloud")


def shown(run, seconds=12.34, problem=""):
    return state_of(run.engine, ABOUT, "yard", seconds, problem)


def test_a_run_shows_who_started_it_where_it_is_and_how_long_it_goes(play):
    state = shown(play(do()), problem="the disk is full")
    assert (state.run, state.edge, state.mission, state.hash) == ("3f2a", "yard", "patrol", "ab12")
    assert (state.started, state.seconds, state.by, state.transport) == (1000.0, 12.3, "anna", "cloud")
    assert (state.phase, state.step, state.outcome, state.problem) == ("step", "go.1", "", "the disk is full")
    assert state.question is None


def test_each_robot_shows_what_it_does_and_what_it_did(play):
    run = play(do(), do("home"), spares={"spot": "feet"}, quorum={})
    run.reply("kestrel").reply("beast", PartOutcome.FAILED, "its motor stalls")
    assert shown(run).robots == (
        RunRobot("kestrel", "eye", lane=("goto done",)),
        RunRobot("beast", "feet", "stop", False, "failed", "its motor stalls", ("goto failed",)),
        RunRobot("rover", "feet", "goto", lane=("goto ...",)),
        RunRobot("spot", "feet", "spare", within=False),
    )


def test_a_question_is_shown_with_the_time_that_is_left(play):
    question = shown(play(Ask("sure", "Go on?", 30.0, "fail")), 12.34).question
    assert (question.id, question.text, question.seconds, question.on_timeout) == (1, "Go on?", 17.7, "fail")


def test_a_run_that_waits_shows_for_what(play):
    run = play(do(), occupies=("gate",))
    run.engine.head.waits_for = "gate, which run 7 has"
    assert shown(run).waits_for == "gate, which run 7 has"


def test_the_end_of_a_run_is_shown_as_it_came(play):
    run = play(do()).handle(StopAll(("kestrel", "beast", "rover"), "ben"))
    state = shown(run)
    assert (state.phase, state.outcome, state.reason) == ("ended", "aborted", "emergency stop: ben")
    assert {(each.outcome, each.doing, each.within) for each in state.robots} == {("stopped", "", False)}


def test_an_ended_run_is_shown_from_what_was_recorded_of_it():
    head = RunHead(Phase.ENDED, at=3, outcome=RunOutcome.WITH_LOSSES, reason="so it was")
    members = [
        RunMember("rex", "eye", 0, outcome=PartOutcome.DONE),
        RunMember("ada", "eye", 1, within=False, outcome=PartOutcome.LOST, reason="gone"),
        RunMember("spot", "eye", 0, ours=False, within=False, spare=True),
    ]
    state = ended_state(ABOUT, head, members, "yard")
    assert (state.phase, state.step, state.outcome, state.reason) == (
        "ended",
        "end",
        "completed_with_losses",
        "so it was",
    )
    assert (state.by, state.hash, state.transport, state.started) == ("anna", "ab12", "cloud", 1000.0)
    assert state.robots == (
        RunRobot("rex", "eye", outcome="done"),
        RunRobot("ada", "eye", "", False, "lost", "gone"),
        RunRobot("spot", "eye", "spare", within=False),
    )
    assert ended_state(ABOUT, RunHead(), [], "yard").outcome == ""


def test_a_state_is_read_as_it_was_sent_with_the_transport_under_its_old_name(play):
    state = shown(play(do(acts={"eye": (Act("command", "takeoff"),)})))
    data = msgspec.json.encode(state)
    assert msgspec.json.decode(data, type=RunState) == state
    assert msgspec.json.decode(data)["way"] == "cloud"


def test_a_start_says_nothing_that_was_not_given():
    assert msgspec.json.encode(MissionStartRequest()) == b"{}"
