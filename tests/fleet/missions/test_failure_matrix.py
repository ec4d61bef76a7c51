"""The failure matrix of docs/how-to/missions.md: a test for each of its rows, and none without."""

import inspect
import re
import shutil
import sqlite3
import sys
from pathlib import Path

import msgspec
import pytest

from fleet.config.missions import mission_of
from fleet.missions.coordination import LAPSES_AFTER, CoordinatorLeases, RobotLeaseRequest
from fleet.missions.engine import Engine
from fleet.missions.program import Act, Enter, Leave
from fleet.missions.report import MissionStartRequest
from fleet.missions.state import (
    Abort,
    Enlisted,
    Facts,
    Left,
    NotStarted,
    PartOutcome,
    PersonAnswer,
    Phase,
    PlaceOccupied,
    Restarted,
    RobotPrepared,
    RunHead,
    RunMember,
    RunOutcome,
    StepPart,
    StopAll,
)
from fleet.missions.store import RunStore
from fleet.model.command import Transport
from tests.fleet.missions.conftest import do
from tests.fleet.missions.yard import MISSION

DOCS = Path(__file__).parents[3] / "docs" / "how-to" / "missions.md"
LAND = {"all": (Act("command", "land", timeout=60.0),)}
EVERYBODY = ("kestrel", "beast", "rover")


def restarted(play):
    """Begin the run anew from what was recorded, as another process does; returns what it was cut off at."""
    old = play.engine
    again = lambda each, kind: msgspec.json.decode(msgspec.json.encode(each), type=kind)  # noqa: E731
    play.engine = Engine(
        "run",
        play.program,
        [again(each, RunMember) for each in old.robots.members.values()],
        head=again(old.head, RunHead),
        parts=[again(each, StepPart) for each in old.robots.parts.values()],
    )
    play.effects.clear()
    for robot in EVERYBODY:
        play.handle(Facts(robot, "ok", 80.0, (0.0, 0.0, 0.0)))
    return play.handle(Restarted())


def test_one_robot_refuses_in_prepare(play):
    run = play(do(together=True))
    run.handle(RobotPrepared("kestrel")).handle(RobotPrepared("beast", "the goal is outside its fence"))
    assert all(words == "stop" for _, words in run.begun()), "nobody moved"
    run.stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED
    assert "beast cannot: the goal is outside its fence; no robot moved" in run.engine.head.reason


def test_robot_fails_in_a_step(play):
    run = play(do(), do("home"))
    run.reply("beast", PartOutcome.FAILED, "its motor stalls")
    assert ("beast", "stop") in run.begun()
    run.stands("beast").reply("kestrel").reply("rover")
    assert [robot for robot, _ in run.begun()[-2:]] == ["kestrel", "rover"]
    run.reply("kestrel").reply("rover")
    assert run.ended is RunOutcome.WITH_LOSSES
    assert run.outcomes() == {"kestrel": "done", "beast": "failed", "rover": "done"}


def test_below_its_quorum_the_run_fails(play):
    run = play(do(undo=LAND), on_failure="undo")
    run.reply("kestrel", PartOutcome.FAILED, "no")
    assert run.engine.head.phase is Phase.HALTING
    run.stands(*EVERYBODY)
    assert run.begun()[-3:] == [(robot, "land") for robot in EVERYBODY]
    run.reply("kestrel").reply("beast").reply("rover")
    assert run.ended is RunOutcome.UNDONE


def test_its_link_falls(play):
    run = play(do(), do("home"))
    run.handle(Left("rover", PartOutcome.LOST, "no heartbeat for 3 s"))
    run.reply("kestrel").reply("beast").reply("kestrel").reply("beast")
    assert run.ended is RunOutcome.WITH_LOSSES
    assert [words for robot, words in run.begun() if robot == "rover"] == ["goto"], "not commanded again"


def test_pilot_or_other_operator_takes_it(play):
    run = play(do(undo=LAND), on_failure="undo")
    run.handle(Left("kestrel", PartOutcome.TAKEN, "authority lost: pilot"))
    run.stands("beast", "rover").reply("beast").reply("rover")
    assert run.ended is RunOutcome.UNDONE
    assert [words for robot, words in run.begun() if robot == "kestrel"] == ["goto"], "no undo for it"


def test_emergency_stop_of_one_robot(play):
    run = play(do(), do("home"))
    run.handle(Left("beast", PartOutcome.STOPPED, "anna"))
    run.reply("kestrel").reply("rover").reply("kestrel").reply("rover")
    assert run.ended is RunOutcome.WITH_LOSSES
    assert run.outcomes()["beast"] is PartOutcome.STOPPED
    assert [words for robot, words in run.begun() if robot == "beast"] == ["goto"]


def test_emergency_stop_of_group_edge_or_all(play):
    run = play(do(undo=LAND), on_failure="undo")
    run.handle(StopAll(EVERYBODY, "anna"))
    assert run.ended is RunOutcome.ABORTED
    assert {words for _, words in run.begun()} == {"goto"}, "nothing is undone"


def test_emergency_stop_of_a_group_with_some_of_its_robots(play):
    run = play(do(undo=LAND), on_failure="undo")
    run.handle(StopAll(("beast", "rover"), "anna"))
    assert run.begun()[-1] == ("kestrel", "stop")
    run.stands("kestrel")
    assert run.ended is RunOutcome.ABORTED


def test_battery_policy_acts(play):
    run = play(do(), do("home"))
    run.handle(Left("rover", PartOutcome.TAKEN, "return_to_home by battery"))
    run.reply("kestrel").reply("beast").reply("kestrel").reply("beast")
    assert run.ended is RunOutcome.WITH_LOSSES
    assert [words for robot, words in run.begun() if robot == "rover"] == ["goto"], "its way home goes on"


def test_require_is_missed_before_a_step(play):
    from fleet.missions.program import Require  # noqa: PLC0415

    run = play(do(), do("home"), require=Require(battery_min=60))
    run.handle(Facts("beast", "ok", 55.0)).reply("kestrel").reply("beast").reply("rover")
    assert run.outcomes()["beast"] is PartOutcome.REFUSED
    assert "55 %, 60 % is required" in run.engine.robots.members["beast"].reason


def test_edge_process_killed_between_steps(play):
    from fleet.missions.program import Wait  # noqa: PLC0415

    run = restarted(play(Wait("rest", 30.0), do(), on_restart="continue"))
    assert run.ended is None
    run.wait(31.0)
    assert run.begun() == [(robot, "goto") for robot in EVERYBODY]


@pytest.mark.parametrize("policy", ["hold_and_ask", "continue"])
def test_edge_process_killed_within_a_step(play, policy):
    run = restarted(play(do(), do("home"), on_restart=policy))
    assert run.begun() == [(robot, "stop") for robot in EVERYBODY], "a begun step is never begun again"
    assert {part.outcome for part in run.engine.robots.parts.values() if part.kind == "do"} == {
        PartOutcome.UNKNOWN
    }
    run.stands(*EVERYBODY).handle(PersonAnswer(1, goes_on=True, by="anna"))
    assert run.begun()[3:] == [(robot, "goto") for robot in EVERYBODY]
    assert all(part.step.startswith("home") for part in run.engine.robots.active())


def test_edge_process_killed_within_the_last_step(play):
    run = restarted(play(do()))
    run.stands(*EVERYBODY).handle(PersonAnswer(1, goes_on=True, by="anna"))
    assert run.ended is RunOutcome.WITH_LOSSES, "nobody saw that it was completed"
    assert {(each.outcome, each.reason) for each in run.engine.robots.members.values()} == {
        (PartOutcome.UNKNOWN, "the end of step go.1 was not observed")
    }


def test_edge_process_killed_and_nobody_answers(play):
    run = restarted(play(do()))
    run.stands(*EVERYBODY).wait(601.0).stands(*EVERYBODY)
    assert run.ended is RunOutcome.ABORTED


def test_edge_process_killed_with_on_restart_fail(play):
    run = restarted(play(do(undo=LAND), on_restart="fail", on_failure="undo"))
    run.stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED
    assert {words for _, words in run.begun()} == {"stop"}


def test_edge_process_killed_while_it_is_undone(play):
    run = play(do(undo=LAND), on_failure="undo")
    run.reply("kestrel", PartOutcome.FAILED, "no").stands(*EVERYBODY)
    restarted(run)
    assert run.ended is RunOutcome.UNDO_FAILED
    assert run.begun() == [], "what may still be landing is left to it"


def test_what_lands_is_not_broken_off(play):
    land = {"eye": (Act("command", "land", timeout=60.0),), "feet": (Act("goto", [1, 1], timeout=60.0),)}
    run = play(do(acts=land))
    run.handle(Left("beast", PartOutcome.LOST, "x")).handle(Left("rover", PartOutcome.LOST, "x"))
    assert run.ended is None, "it waits for the landing"
    assert run.begun()[-1] == ("rover", "goto"), "nobody is stopped"
    run.reply("kestrel")
    assert run.ended is RunOutcome.FAILED


def test_a_place_is_not_free_in_time(play):
    run = play(do(), occupies=("gate",))
    run.handle(PlaceOccupied("gate, which run 7 of patrol has"))
    assert run.engine.head.phase is Phase.OCCUPYING
    run.handle(PlaceOccupied(late="gate did not become free in time: run 7 of patrol has it"))
    assert [words for _, words in run.begun()] == ["stop"] * 3, "nothing was begun"
    run.stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED


def test_a_robot_is_lost_that_has_a_spare(play):
    run = play(do(), do("home"), spares={"spot": "feet"}, quorum={"feet": 2})
    run.handle(Left("beast", PartOutcome.LOST, "gone")).reply("kestrel").reply("rover")
    run.handle(Enlisted("spot")).reply("kestrel").reply("rover").reply("spot")
    assert run.ended is RunOutcome.WITH_LOSSES
    assert run.outcomes()["spot"] == "done"


def test_undo_fails(play):
    run = play(do(undo=LAND), on_failure="undo")
    run.reply("kestrel", PartOutcome.FAILED, "no").stands(*EVERYBODY)
    run.reply("beast", PartOutcome.REFUSED, "it has a fault").stands("beast").reply("kestrel").reply("rover")
    assert run.ended is RunOutcome.UNDO_FAILED
    assert "beast could not undo go.1: it has a fault" in run.engine.head.reason


def test_clock_jumps(play):
    run = play(do(), deadline=100.0)
    run.wait(99.0)
    assert run.ended is None
    run.wait(2.0).stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED


def test_bus_partition_two_edges(play):
    """The run's side and the other edge's, each for itself; both together: test_partners.py of the edge."""
    run = play(do(failed_do="land"), do("home"))
    leases = CoordinatorLeases()
    leases.grant(RobotLeaseRequest("run", "yard", {"rover": run.program.steps[0].failed_do}), 0.0)
    run.handle(Left("rover", PartOutcome.LOST, "edge barn does not answer"))
    assert [(each.robot, each.do) for each in leases.lapsed(LAPSES_AFTER)] == [("rover", "land")]
    assert "rover" not in [robot for robot, _ in run.begun()[3:]]
    run.reply("kestrel").reply("beast").reply("kestrel").reply("beast")
    assert run.ended is RunOutcome.WITH_LOSSES


def test_a_person_aborts(play):
    run = play(do(), on_abort="land")
    run.handle(Abort("anna"))
    assert run.begun()[3:] == [(robot, "land") for robot in EVERYBODY]
    run.reply("kestrel").reply("beast").reply("rover")
    assert run.ended is RunOutcome.ABORTED


def test_cloud_away(yard):
    yard.start(transport=Transport.CLOUD, source_type="tele")
    yard.done("kestrel", "takeoff")  # nothing here reaches a cloud: a run needs none
    yard.done("kestrel", "goto")
    yard.done("beast", "goto")
    assert yard.last.outcome == "completed"


def test_computer_power_cut(yard, tmp_path_factory):
    yard.start()
    assert yard.robots["kestrel"].names == ["takeoff"]
    folder = tmp_path_factory.mktemp("disk")
    for file in yard.folder.iterdir():  # as it is on the disk at this instant: nothing is closed
        shutil.copy(file, folder)
    (kept,) = RunStore(folder).unfinished()
    yard.folder = folder
    yard.begin()
    for robot in yard.robots.values():
        robot.be(run="")
    yard.runs.restore_runs()
    yard.turn()
    assert [part.identity for part in kept.parts] == ["3f2a/up.1/kestrel/1"]
    assert yard.robots["kestrel"].names == ["takeoff", "stop"], "a begun step is never begun again"
    assert yard.last.question is not None


def test_the_record_of_runs_is_unreadable(yard):
    yard.start()
    yard.store.close()
    for file in yard.folder.glob("missions.db*"):
        file.write_bytes(b"no database" * 1000)
    before = len(yard.robots["kestrel"].requests)
    yard.begin()
    yard.runs.restore_runs()
    yard.turn()
    assert "set aside" in yard.store.lost, "a person is told"
    assert (yard.runs.states(), len(yard.robots["kestrel"].requests)) == ([], before)


def test_disk_full(yard):
    yard.start()
    yard.store._database.close()
    yard.store._database = sqlite3.connect(":memory:", check_same_thread=False)  # takes nothing
    yard.done("kestrel", "takeoff")
    assert yard.robots["kestrel"].names == ["takeoff", "goto"], "one that is under way goes on"
    yard.turn()
    ((run, _, refusal),) = yard.start(run="77")
    assert run == ""
    assert "not recorded" in refusal


def test_mission_is_edited_or_a_robot_is_removed(yard):
    yard.start()
    yard.begin()
    del yard.robots["beast"]
    yard.robots["kestrel"].be(run="")
    yard.runs.restore_runs()
    yard.turn()
    robots = {each.robot: (each.outcome, each.reason) for each in yard.last.robots}
    assert robots["beast"] == ("lost", "it was removed from fleet.yaml")
    (kept,) = RunStore(yard.folder).unfinished()
    assert [step.id for step in kept.program.steps] == ["up", "go"], "the run has a copy of its own"


def test_two_schedules_want_one_robot(yard):
    yard.start()
    other = mission_of("other", {**MISSION, "steps": MISSION["steps"][:1]})
    found = yard.runs.filling.conflicting_runs(other, other.program({}), MissionStartRequest(run="77"))
    assert found == ["3f2a"], "the busy rule decides, and names it"


def test_a_mission_within_the_mission_fails(play):
    enter = Enter("in", "scan", "in.all", 3, {"in.a": 1})
    inner = do("in.go", acts={"in.all": (Act("goto", [1, 1], timeout=60.0),)})
    plays = {"beast": {"in.a": 0, "in.all": 0}}
    run = play(enter, inner, Leave(0, "in"), do("home"), plays=plays, quorum={"eye": 1})
    run.reply("beast", PartOutcome.FAILED, "no").stands("beast").reply("kestrel").reply("rover")
    assert run.ended is RunOutcome.WITH_LOSSES
    assert run.outcomes()["beast"] == "failed"


def test_the_common_start_is_taken_back(play):
    run = play(do(together=True))
    for robot in EVERYBODY:
        run.handle(RobotPrepared(robot))
    run.handle(NotStarted("go.1", "beast: its emergency stop is set")).stands(*EVERYBODY)
    assert run.ended is RunOutcome.FAILED
    assert "no robot moved" in run.engine.head.reason


def test_every_row_of_the_matrix_has_its_test():
    table = DOCS.read_text(encoding="utf-8").partition("## Failure matrix")[2].partition("\n## ")[0]
    rows = re.findall(r"\| `(test_\w+)` \|$", table, re.MULTILINE)
    here = {name for name, _ in inspect.getmembers(sys.modules[__name__], inspect.isfunction)}
    tests = {name for name in here if name.startswith("test_")} - {
        test_every_row_of_the_matrix_has_its_test.__name__
    }
    assert set(rows) == tests
    assert len(rows) == len(set(rows))
