"""What is remembered of commands and stops when the process dies, is started anew, or its disk fails."""

import asyncio
import contextlib
import itertools
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.history.store import HISTORY, History
from fleet.host.journal.changes import CommandEnd
from fleet.host.journal.execution_journal import Latched, StartedCommand
from fleet.host.journal.journal import RETRY, Journal
from fleet.host.journal.journal_file import LOST, REMEMBERED
from fleet.model.command import Origin, ReplyStatus, Transport
from fleet.model.geometry import Vector3
from fleet.model.navigation import Navigate, RelativeMove
from fleet.model.report import NavigationReport
from fleet.spool.state_folder import JOURNAL, locked
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE, wait_until

ACCEPTED, REJECTED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def opened(tmp_path, clock):
    """Open the journal of a new process each time; close them all."""
    journals = []

    def opened():
        while journals:
            journals.pop().close()
        journals.append(Journal(tmp_path, clock, tmp_path / "begun.main"))
        return journals[-1]

    yield opened
    while journals:
        journals.pop().close()


@pytest.fixture
def restarted(opened, make_bench):
    """Return the controller of a robot in a new process."""

    def restarted():
        return make_bench(journal=opened().robot("rex"))

    return restarted


def commit(journal, changes):
    """Write changes in one commit."""
    with journal._using:
        journal._unwritten.add(changes)
        journal._commit()


async def ended(answers):
    """Wait until an ask has ended, with the disk between."""
    async with asyncio.timeout(60):
        while not answers:  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.005)


async def test_a_command_is_not_carried_out_again_after_a_restart(restarted, requests):
    bench = restarted()
    await ended(bench.request(requests.command("land", id="r1")))
    assert bench.adapter.calls == ["land"]
    bench = restarted()
    (answer,) = bench.request(requests.command("land", id="r1"))
    await requests.settle()
    assert (bench.adapter.calls, answer.status) == ([], ACCEPTED)
    await ended(bench.request(requests.command("land", id="r2")))
    assert bench.adapter.calls == ["land"]


async def test_a_command_that_was_cut_off_is_refused_after_the_restart(restarted, requests):
    bench = restarted()
    bench.request(requests.command("takeoff", id="r1"))
    await requests.until(lambda: bench.adapter.calls)
    (answer,) = restarted().request(requests.command("takeoff", id="r1"))
    assert answer.status is REJECTED
    assert answer.reason.startswith("it was started before the edge restarted and was not seen to end")


async def test_a_command_is_remembered_before_its_method_is_called(tmp_path, clock, restarted, requests):
    bench = restarted()
    seen = []

    async def land():
        journal = Journal(tmp_path, clock, tmp_path / "begun.other")
        seen.extend(journal.robot("rex").past)
        journal.close()

    bench.adapter.land = land
    await ended(bench.request(requests.command("land", id="r1")))
    assert [(past.identity, past.outcome) for past in seen] == [("r1", "")]


async def test_an_action_that_was_cut_off_fails_once_and_is_not_begun_again(restarted, requests):
    bench = restarted()
    bench.request(requests.goal("a1"))
    await requests.until(lambda: bench.adapter.calls)
    for statuses, words in (([("a1", "failed")], ["stop"]), ([], [])):
        bench = restarted()
        bench.controller.statuses.recall()
        reports = [one for one in bench.reports if isinstance(one, NavigationReport)]
        assert [(one.action_id, one.state) for one in reports] == statuses
        bench.request(requests.goal("a1"))
        await requests.settle()
        assert bench.adapter.calls == words


@pytest.mark.parametrize(("name", "expected"), [("move_forward", ["move_forward"]), ("navigate", [])])
async def test_the_end_of_a_way_is_owed_to_who_asked_it_as_a_command(
    opened, restarted, requests, name, expected
):
    bench = restarted()
    bench.request(
        Navigate(RelativeMove(Vector3(1.0, 0.0, 0.0)), "m1", Origin(Transport.CLOUD, "tele"), name=name)
    )
    await requests.until(lambda: bench.adapter.calls)
    assert [each.name for each in opened().take_interrupted(["rex"])] == expected


async def test_a_release_of_earlier_does_not_release_a_later_stop(restarted, requests):
    bench = restarted()
    bench.request(requests.command("release_emergency_stop", id="r1"))
    bench.request(requests.command("emergency_stop"))
    await requests.settle()
    bench = restarted()
    bench.request(requests.command("release_emergency_stop", id="r1"))
    assert bench.controller.latched
    bench.request(requests.command("release_emergency_stop", id="r2"))
    assert not bench.controller.latched
    assert not restarted().controller.latched


async def test_an_emergency_stop_survives_a_restart_and_nothing_moves_until_its_release(restarted, requests):
    restarted().controller.emergency("asked by anna")
    bench = restarted()
    (refused,) = bench.request(requests.setpoint())
    assert "asked by anna" in refused.reason
    assert bench.adapter.calls == []


def test_another_robots_stop_is_its_own(opened):
    opened().robot("rex").latch("anna")
    journal = opened()
    assert (journal.robot("rex").latched, journal.robot("max").latched) == ("anna", "")


def test_what_is_long_past_is_forgotten(opened, clock):
    opened().robot("rex").note("r1", "land")
    assert [past.identity for past in opened().robot("rex").past] == ["r1"]
    clock.advance(REMEMBERED + 1)
    opened().robot("rex").note("r2", "land")
    assert [past.identity for past in opened().robot("rex").past] == ["r2"]


def test_the_clock_of_a_computer_without_a_battery_does_not_make_it_forget(opened, clock):
    opened().robot("rex").note("r1", "land")
    clock.step(-clock.time())
    assert [past.identity for past in opened().robot("rex").past] == ["r1"]


def test_a_journal_that_cannot_be_read_is_set_aside_and_every_robot_is_stopped(tmp_path, opened):
    (tmp_path / JOURNAL).write_bytes(b"not a database" * 1000)
    rex = opened().robot("rex")
    assert rex.latched == LOST
    rex.latch("")
    journal = opened()
    assert (journal.robot("rex").latched, journal.robot("max").latched) == ("", LOST)
    assert (tmp_path / f"{JOURNAL}.broken").exists()


async def test_a_disk_that_fails_is_reported_and_commands_go_on(tmp_path, clock, make_bench, requests):
    (tmp_path / "file").write_text("in the way")
    journal = Journal(tmp_path / "file", clock, tmp_path / "begun.main")
    assert "cannot create" in journal.problem
    bench = make_bench(journal=journal.robot("rex"))
    await ended(bench.request(requests.command("land", id="r1")))
    assert bench.adapter.calls == ["land"]
    journal.close()


def test_a_disk_that_fills_up_is_reported_and_one_that_is_well_again_too(opened, requests):
    journal = opened()
    rex = journal.robot("rex")
    journal._file._database.execute("PRAGMA max_page_count = 1")
    rex.latch("x" * 100_000)
    wait_until("the trouble is told", lambda: "full" in journal.problem)
    journal._file._database.execute("PRAGMA max_page_count = 100000")
    commit(journal, [])
    assert journal.problem == ""


def test_what_the_disk_has_is_no_longer_kept_in_memory(tmp_path, opened):
    journal = opened()
    for number in range(100):
        journal.robot("rex").note(f"r{number}", "land")
    opened()
    assert (tmp_path / "begun.main").read_bytes().strip(b"\0") == b""
    assert len(opened().robot("rex").past) == 100


def test_a_stop_that_is_not_on_the_disk_yet_is_set_again_and_a_release_is_not(tmp_path, opened):
    (tmp_path / "begun.arm").write_bytes(
        b'["latch","rex","the stop key"]\n["latch","max","fire"]\n["latch","max",""]\n'
    )
    journal = opened()
    assert journal.robot("rex").latched == "the stop key"
    assert not journal.robot("max").latched


def test_a_release_outlives_the_stop_that_a_dead_process_left(tmp_path, opened):
    (tmp_path / "begun.arm").write_bytes(b'["latch","rex","the stop key"]\n')
    journal = opened()
    journal.robot("rex").latch("")
    journal.close()
    assert not opened().robot("rex").latched


def test_what_a_process_that_lives_has_not_written_yet_is_left_to_it(tmp_path, clock, opened, monkeypatch):
    monkeypatch.setattr("fleet.host.journal.journal.GATHER", 600.0)
    other = Journal(tmp_path, clock, tmp_path / "begun.arm")
    other.robot("max").latch("fire")
    before = (tmp_path / "begun.arm").read_bytes()
    assert opened().robot("max").latched == "fire"
    assert (tmp_path / "begun.arm").read_bytes() == before != b""
    other.close()


def test_a_stop_after_the_end_is_written_into_nobody_elses_file(tmp_path, clock):
    journal = Journal(tmp_path, clock, tmp_path / "begun.main")
    robot, number = journal.robot("rex"), journal._execution_journal._file
    journal.close()
    another = os.open(tmp_path / "another", os.O_WRONLY | os.O_CREAT)
    os.dup2(another, number)  # the number that was its own is another's now
    robot.latch("too late")
    for each in {another, number}:
        os.close(each)
    assert (tmp_path / "another").read_bytes() == b""


def test_half_a_line_of_a_process_that_was_killed_is_none(tmp_path, opened):
    (tmp_path / "begun.arm").write_bytes(b'["begin","rex","r1","land",false,2e9]\n["begin","rex","r2","la')
    (tmp_path / "begun.main").write_bytes(b'["begin","rex","r3","land",false,3e9]\n')
    assert [past.identity for past in opened().robot("rex").past] == ["r1", "r3"]


def test_what_stands_behind_the_end_of_a_file_is_forgotten(tmp_path, opened):
    (tmp_path / "begun.arm").write_bytes(b'\0"latch","rex","fire"]\n["latch","max","fire"]\n')
    (tmp_path / "begun.main").write_bytes(b'["latch","eve","fire"]\n\0["latch","max","fire"]\n')
    journal = opened()
    assert [journal.robot(name).latched for name in ("rex", "max", "eve")] == ["", "", "fire"]


NOW = ManualClock().time()
NAMES = st.sampled_from(["rex", "max", "e\0v"])
CHANGES = st.lists(
    st.builds(
        StartedCommand,
        NAMES,
        st.sampled_from("abc"),
        st.just("land"),
        st.booleans(),
        st.floats(NOW, NOW + 9.0),
    )
    | st.builds(CommandEnd, st.sampled_from(["completed", "failed"]), NAMES, st.sampled_from("abc"))
    | st.builds(Latched, NAMES, st.sampled_from(["", "fire", "smoke"])),
    max_size=30,
)


@settings(deadline=None)
@given(CHANGES, st.lists(st.integers(0, 30), max_size=3))
def test_changes_come_to_the_same_in_one_commit_or_in_many(tmp_path_factory, changes, cuts):
    seen = []
    for places in (sorted(cuts), range(len(changes))):
        folder = tmp_path_factory.mktemp("journal")
        journal = Journal(folder, ManualClock(), folder / "begun.main")
        for start, end in itertools.pairwise([0, *places, len(changes)]):
            commit(journal, changes[start:end])
        robots = [journal.robot(name) for name in ("rex", "max", "e\0v")]
        seen.append([(robot.latched, {past.identity: past for past in robot.past}) for robot in robots])
        journal.close()
    assert seen[0] == seen[1]


def test_more_commands_than_one_statement_takes_are_remembered(opened):
    journal = opened()
    commit(journal, [StartedCommand("rex", f"r{number}", "land", False, NOW) for number in range(257)])
    assert len(opened().robot("rex").past) == 257


def test_a_stop_does_not_fail_by_its_record(opened, monkeypatch):
    def fail(_row):
        raise ValueError("odd")

    journal = opened()
    monkeypatch.setattr(journal._execution_journal, "add", fail)
    journal.robot("rex").latch("fire")
    assert "odd" in journal.problem
    assert opened().robot("rex").latched == "fire"


async def test_an_emergency_stop_halts_the_robot_though_its_record_fails(
    opened, make_bench, requests, monkeypatch
):
    def fail(_row):
        raise ValueError("odd")

    journal = opened()
    monkeypatch.setattr("fleet.host.robot.controller.HALT_WAIT", 20.0)
    monkeypatch.setattr(journal._execution_journal, "add", fail)
    bench = make_bench(journal=journal.robot("rex"))
    bench.request(requests.command("emergency_stop"))
    await requests.settle()
    assert bench.adapter.calls[0] == "halt"
    assert bench.controller.latched


def test_more_is_kept_in_memory_than_the_file_was_made_for_when_the_disk_takes_nothing(
    tmp_path, clock, opened, monkeypatch
):
    monkeypatch.setattr("fleet.host.journal.journal.GATHER", 600.0)
    journal = opened()
    for number in range(3000):
        journal.robot("rex").note(f"r{number}", "land")
    journal.robot("rex").latch("fire")
    form, *rows = (tmp_path / "begun.main").read_bytes().partition(b"\0")[0].splitlines()
    assert form == b'["format",1]'
    assert len(rows) == 3001
    assert rows[-1] == b'["latch","rex","fire"]'


def test_a_stop_with_many_words_is_kept_in_memory_too(tmp_path, opened, monkeypatch):
    monkeypatch.setattr("fleet.host.journal.journal.GATHER", 600.0)
    journal = opened()
    journal.robot("rex").latch("x" * 500_000)
    journal.robot("max").latch("fire")
    rows = (tmp_path / "begun.main").read_bytes().partition(b"\0")[0].splitlines()
    assert [len(row) for row in rows] == [12, 500_018, 22]


def test_a_memory_that_is_full_is_reported_and_the_stop_is_on_the_disk_all_the_same(
    tmp_path, opened, monkeypatch
):
    journal = opened()
    monkeypatch.setattr("os.pwrite", lambda _file, data, _at: len(data) - 1)
    journal.robot("rex").latch("x" * 500_000)
    assert "No space left" in journal.problem
    second = Journal(tmp_path / "second", ManualClock(), tmp_path / "begun.second")
    assert "No space left" in second.problem
    second.close()
    assert opened().robot("rex").latched == "x" * 500_000


KILLED = """
import os, signal, sys
from pathlib import Path
from fleet.testing.clock import ManualClock
from fleet.host.journal.journal import Journal
from tests.tools.waiting import DEADLINE, wait_until

def main():
    folder, memory = map(Path, sys.argv[1:])
    journal = Journal(folder, ManualClock(), memory / "begun.main")
    rex = journal.robot("rex")
    rex.latch("asked by anna")
    rex.note("r1", "takeoff")
    wait_until("it is on the disk", lambda: not journal._waiting and journal._recall("rex")[0])
    os.kill(os.getpid(), signal.SIGKILL)

main()
"""


def test_a_killed_process_leaves_what_it_began_and_its_stop(tmp_path, opened):
    run = subprocess.run([sys.executable, "-c", KILLED, tmp_path, tmp_path], check=False)
    assert run.returncode == -signal.SIGKILL
    rex = opened().robot("rex")
    assert rex.latched == "asked by anna"
    assert [past.identity for past in rex.past] == ["r1"]


def _damaged(folder):
    for path in folder.glob("journal.db*"):
        path.write_bytes(b"\xff" * max(4096, path.stat().st_size))


def _missing(folder):
    for path in folder.glob("journal.db*"):
        path.unlink()


def _folder_is_a_file(folder):
    shutil.rmtree(folder)
    folder.write_text("")


LOSSES = {
    "the journal is damaged": _damaged,
    "the journal is missing": _missing,
    "the journal's newest part is missing": lambda folder: (folder / "journal.db-wal").unlink(),
    "the journal is a folder": lambda folder: (_missing(folder), (folder / "journal.db").mkdir()),
    "the folder cannot be had": _folder_is_a_file,
    "the lock cannot be had": lambda folder: (
        (folder / "journal.db.lock").unlink(),
        (folder / "journal.db.lock").mkdir(),
    ),
    "the file in memory is missing": lambda folder: (folder.parent / "begun.main").unlink(),
}


@pytest.fixture
def stopped_and_killed(tmp_path):
    """Return the state folder of a process that set rex's stop, wrote it, and was killed."""
    folder = tmp_path / "state"
    assert subprocess.run([sys.executable, "-c", KILLED, folder, tmp_path], check=False).returncode == -9
    return folder


@pytest.mark.parametrize("loss", LOSSES)
def test_a_stop_outlives_the_loss_of_what_it_was_written_to(stopped_and_killed, tmp_path, clock, loss):
    LOSSES[loss](stopped_and_killed)
    journal = Journal(stopped_and_killed, clock, tmp_path / "begun.main")
    assert journal.robot("rex").latched
    journal.close()


NOTHING_CAN_BE_WRITTEN = """
import os, resource, signal, sys
from pathlib import Path
from fleet.testing.clock import ManualClock
from fleet.host.journal.journal import Journal
from fleet.host.journal.journal_file import LOST

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
folder, memory = map(Path, sys.argv[1:])
journal = Journal(folder, ManualClock(), memory / "begun.main")
assert journal.robot("max").latched == LOST, journal.robot("max").latched
assert "journal" in journal.problem
journal.close()
"""


@pytest.mark.parametrize("known", [True, False])
def test_a_disk_that_takes_nothing_at_the_start_stops_every_robot(tmp_path, opened, known):
    if known:
        opened().close()
    line = [sys.executable, "-c", NOTHING_CAN_BE_WRITTEN, tmp_path, tmp_path]
    ended = subprocess.run(line, check=False, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_the_first_start_of_an_edge_stops_nobody(opened):
    assert opened().robot("rex").latched == ""


def test_a_stop_that_was_released_is_in_neither_place_any_more(stopped_and_killed, tmp_path, clock):
    journal = Journal(stopped_and_killed, clock, tmp_path / "begun.main")
    journal.robot("rex").latch("")
    journal.close()
    assert b"asked by anna" not in (tmp_path / "begun.main").read_bytes()
    journal = Journal(stopped_and_killed, clock, tmp_path / "begun.main")
    assert journal.robot("rex").latched == ""
    journal.close()


def test_a_process_keeps_only_its_own_robots_stops_in_memory(tmp_path, clock):
    main, arm = (Journal(tmp_path, clock, tmp_path / f"begun.{name}") for name in ("main", "arm"))
    main.robot("rex").latch("panel")
    main.close()
    arm.robot("max")
    arm.close()
    assert b"rex" not in (tmp_path / "begun.arm").read_bytes()


def test_commands_in_memory_are_bounded_while_the_disk_takes_nothing(tmp_path, clock, monkeypatch):
    monkeypatch.setattr("fleet.host.journal.journal.LONGEST", 10_000)
    (tmp_path / "state").write_text("")
    journal = Journal(tmp_path / "state", clock, tmp_path / "begun.main")
    rex = journal.robot("rex")
    rex.latch("panel")
    for number in range(1000):
        rex.note(f"r{number}", "land")
    wait_until("it is short again", lambda: journal._execution_journal.length < 10_000)
    assert b"panel" in (tmp_path / "begun.main").read_bytes()
    journal.close()


def test_two_processes_write_one_journal(tmp_path, clock):
    first, second = (Journal(tmp_path, clock, tmp_path / f"begun.{name}") for name in ("main", "arm"))
    for number in range(50):
        first.robot("rex").note(f"a{number}", "land")
        second.robot("max").note(f"b{number}", "land")
    first.close()
    second.close()
    third = Journal(tmp_path, clock, tmp_path / "begun.main")
    assert (len(third.robot("rex").past), len(third.robot("max").past)) == (50, 50)
    third.close()


def test_a_stop_is_on_the_disk_though_another_process_holds_the_history(tmp_path, clock):
    history = History(tmp_path, clock)
    with locked(tmp_path / HISTORY):
        journal = Journal(tmp_path, clock, tmp_path / "begun.main", also=history.write)
        wait_until("the history has been tried", lambda: history.problem)
        journal.robot("rex").latch("asked")
        wait_until("the stop is on the disk", lambda: latches(tmp_path) == [("rex", "asked")])
        closing = threading.Thread(target=journal.close, daemon=True)
        closing.start()
        closing.join(DEADLINE / 4)
        assert not closing.is_alive()
    history.close()


def test_a_stop_is_on_the_disk_before_the_history_has_its_turn(tmp_path, clock):
    seen = []
    journal = Journal(tmp_path, clock, tmp_path / "begun.main", also=lambda: seen.append(latches(tmp_path)))
    journal.robot("rex").latch("asked")
    journal.close()
    assert seen[-1] == [("rex", "asked")]


def latches(folder):
    """Return what another process finds on the disk of the stops that are set."""
    with contextlib.closing(sqlite3.connect(folder / JOURNAL)) as database:
        return database.execute("SELECT robot, why FROM latch").fetchall()


def test_a_stop_that_a_full_disk_did_not_take_is_written_once_there_is_room_though_nothing_follows(
    tmp_path, clock, opened
):
    journal = opened()
    rex = journal.robot("rex")
    journal._file._database.execute("PRAGMA max_page_count = 1")
    rex.latch("x" * 100_000)
    wait_until("the trouble is told", lambda: "full" in journal.problem)
    with journal._using:
        journal._file._database.execute("PRAGMA max_page_count = 100000")
    clock.advance(RETRY)
    wait_until("the disk takes it", lambda: not journal.problem)
    with contextlib.closing(sqlite3.connect(tmp_path / JOURNAL)) as disk:
        assert disk.execute("SELECT robot FROM latch WHERE why <> ''").fetchall() == [("rex",)]
