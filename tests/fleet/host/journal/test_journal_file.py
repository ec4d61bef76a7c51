"""What of stops and commands is left when the database fails for a while, or for good."""

import contextlib
import os
import sqlite3

import pytest

from fleet.host.journal.execution_journal import ExecutionJournal, Latched, StartedCommand
from fleet.host.journal.journal import RETRY, Journal
from fleet.host.journal.journal_file import LOST
from fleet.spool.state_folder import JOURNAL
from fleet.testing.clock import ManualClock
from tests.tools.waiting import wait_until

BEGUN = "begun.main"


@pytest.fixture
def clock():
    return ManualClock()


class Edge:
    """An edge's processes, one after another, their disk and their computer."""

    def __init__(self, folder, clock):
        self.state = folder / "state"
        self.memory = folder / "memory"
        self.memory.mkdir()
        self.clock = clock
        self.journal = None

    def start(self):
        """Start a process."""
        self.journal = Journal(self.state, self.clock, self.memory / BEGUN)
        return self.journal

    def kill(self):
        """End the process such that it writes nothing more."""
        self.journal._keep = lambda **_: None
        self.journal.problem = "killed"
        self.journal.close()

    def lose_power(self):
        """End the process, and lose what was in memory."""
        self.kill()
        for path in self.memory.iterdir():
            path.unlink()

    def fill_disk(self):
        """Let the database take nothing more."""
        with self.journal._using:
            self.journal._file._database.execute("PRAGMA max_page_count = 1")

    def free_disk(self):
        """Let the database take something again."""
        with self.journal._using:
            self.journal._file._database.execute("PRAGMA max_page_count = 100000")
        self.clock.advance(RETRY)

    def block_folder(self):
        """Put something in the place of the database, as an unmounted disk or a lost permission does."""
        self.state.mkdir(exist_ok=True)
        (self.state / JOURNAL).mkdir()

    def unblock_folder(self):
        (self.state / JOURNAL).rmdir()
        self.clock.advance(RETRY)

    def until_written(self):
        wait_until("the disk takes it", self._is_written)

    def _is_written(self):
        with self.journal._using:
            return not (self.journal.problem or self.journal._waiting or self.journal._unwritten)

    def until_failed(self):
        wait_until("the trouble is told", lambda: self.journal.problem)

    def known(self, robot="rex"):
        return [past.identity for past in self.journal.robot(robot).past]


@pytest.fixture
def edge(tmp_path, clock):
    """Make an edge; its last process ends with the test."""
    made = Edge(tmp_path, clock)
    yield made
    if made.journal is not None:
        made.kill()


def test_a_command_that_a_full_disk_did_not_take_is_known_after_the_next_commit(edge):
    edge.start()
    rex = edge.journal.robot("rex")
    edge.fill_disk()
    rex.note("r1", "x" * 100_000)
    edge.until_failed()
    edge.free_disk()
    rex.note("r2", "land")
    edge.until_written()
    edge.lose_power()
    edge.start()
    assert edge.known() == ["r1", "r2"]


def test_the_end_of_a_command_that_a_full_disk_did_not_take_is_known_too(edge):
    edge.start()
    rex = edge.journal.robot("rex")
    rex.note("r1", "land")
    edge.until_written()
    edge.fill_disk()
    rex.note("r2", "x" * 100_000)
    edge.until_failed()
    rex.end("r1", "completed")
    edge.free_disk()
    edge.until_written()
    edge.lose_power()
    edge.start()
    outcomes = {past.identity: past.outcome for past in edge.journal.robot("rex").past}
    assert outcomes == {"r1": "completed", "r2": ""}


def test_a_full_disk_is_tried_again_now_and_then_and_not_with_each_command(edge, monkeypatch):
    edge.start()
    rex = edge.journal.robot("rex")
    edge.fill_disk()
    rex.note("r1", "x" * 100_000)
    edge.until_failed()
    tried = []
    monkeypatch.setattr(edge.journal._file, "commit", lambda *_: tried.append(1))
    rex.note("r2", "land")
    wait_until("it is gathered", lambda: ("rex", "r2") in edge.journal._unwritten.commands)
    assert not tried
    edge.clock.advance(RETRY)
    wait_until("it is tried", lambda: tried)


def test_a_process_without_a_database_begins_with_what_an_earlier_one_had_begun(edge):
    edge.start()
    edge.fill_disk()
    edge.journal.robot("rex").note("r1", "takeoff", action=True)
    edge.kill()
    for path in edge.state.glob("journal.db*"):
        path.unlink()
    edge.block_folder()
    edge.start()
    rex = edge.journal.robot("rex")
    assert rex.latched == LOST
    assert [past.identity for past in rex.past] == ["r1"]
    assert rex.cut_off


def test_a_database_that_comes_later_gets_all_that_happened_until_then(edge):
    edge.start().robot("rex").latch("of yesterday")
    edge.until_written()
    edge.journal.robot("max").latch("of yesterday")
    edge.until_written()
    edge.lose_power()
    (edge.state / JOURNAL).rename(edge.state / "unmounted")
    for path in edge.state.glob("journal.db*"):
        path.rename(path.with_name(path.name.replace(JOURNAL, "unmounted")))
    edge.block_folder()
    edge.start()
    edge.journal.robot("rex").latch("")
    eve = edge.journal.robot("eve")
    eve.latch("")
    eve.note("r1", "land")
    eve.latch("fire")
    edge.until_failed()
    (edge.state / JOURNAL).rmdir()
    for path in edge.state.glob("unmounted*"):
        path.rename(path.with_name(path.name.replace("unmounted", JOURNAL)))
    edge.clock.advance(RETRY)
    edge.until_written()
    edge.lose_power()
    edge.start()
    latched = {name: edge.journal.robot(name).latched for name in ("rex", "max", "eve", "ugv")}
    assert latched == {"rex": "", "max": "of yesterday", "eve": "fire", "ugv": ""}
    assert edge.known("eve") == ["r1"]


@pytest.mark.parametrize("failing", ["from the start", "since then"])
def test_a_stop_that_the_disk_never_took_stops_every_robot_after_a_power_cut(edge, failing):
    if failing == "from the start":
        edge.block_folder()
        edge.start()
        rex = edge.journal.robot("rex")
        rex.latch("")
        rex.latch("fire")
    else:
        edge.start()
        rex = edge.journal.robot("rex")
        edge.fill_disk()
        rex.latch("x" * 100_000)
    edge.until_failed()
    wait_until("it is marked", lambda: list(edge.state.glob("*unwritten*")))
    edge.lose_power()
    if failing == "from the start":
        (edge.state / JOURNAL).rmdir()
    for _ in range(2):  # the mark is gone, the stop is not
        edge.start()
        assert edge.journal.robot("rex").latched == LOST
        assert not list(edge.state.glob("*unwritten*"))
        edge.lose_power()


@pytest.mark.parametrize("how", ["written", "released"])
def test_once_the_disk_has_the_stop_or_it_was_released_no_other_robot_is_stopped_for_it(edge, how):
    edge.start()
    rex = edge.journal.robot("rex")
    edge.fill_disk()
    rex.latch("x" * 100_000)
    wait_until("it is marked", lambda: list(edge.state.glob("*unwritten*")))
    if how == "released":
        rex.latch("")
    edge.free_disk()
    wait_until("the mark is gone", lambda: not list(edge.state.glob("*unwritten*")))
    edge.lose_power()
    edge.start()
    assert not edge.journal.robot("max").latched


def test_a_mark_of_an_earlier_process_counts_though_the_next_one_had_no_database_either(edge):
    edge.state.mkdir()
    (edge.state / f"{JOURNAL}.unwritten-{BEGUN}").touch()
    edge.block_folder()
    edge.start()
    edge.journal.robot("rex").latch("")
    edge.until_failed()
    edge.unblock_folder()
    edge.until_written()
    edge.lose_power()
    edge.start()
    assert (edge.journal.robot("rex").latched, edge.journal.robot("max").latched) == ("", LOST)


def test_a_stop_is_written_though_its_cause_is_no_text(edge):
    edge.start().robot("rex").latch("asked by r\udce9mi")
    edge.until_written()
    edge.lose_power()
    edge.start()
    assert edge.journal.robot("rex").latched == "asked by r?mi"


def test_the_thread_of_the_journal_outlives_a_failure(edge, monkeypatch):
    edge.start()
    rex = edge.journal.robot("rex")
    with monkeypatch.context() as ill:
        ill.setattr(edge.journal._file, "commit", lambda *_: {}["oops"])
        rex.note("r1", "land")
        edge.until_failed()
    edge.clock.advance(RETRY)
    edge.until_written()
    edge.lose_power()
    edge.start()
    assert edge.known() == ["r1"]


def test_a_robot_that_is_added_again_knows_what_the_disk_does_not(edge):
    edge.start()
    rex = edge.journal.robot("rex")
    edge.fill_disk()
    rex.note("r1", "x" * 100_000)
    rex.latch("fire")
    rex.latch("")
    edge.until_failed()
    again = edge.journal.robot("rex")
    assert ([past.identity for past in again.past], again.latched) == (["r1"], "")


def test_of_many_commands_that_no_disk_takes_the_newest_are_known_to_the_next_process(edge, monkeypatch):
    monkeypatch.setattr("fleet.host.journal.journal.LONGEST", 10_000)
    edge.block_folder()
    edge.start()
    rex = edge.journal.robot("rex")
    for number in range(1000):
        rex.note(f"r{number}", "land")
    wait_until("it is short again", lambda: edge.journal._execution_journal.length < 10_000)
    edge.kill()
    edge.unblock_folder()
    edge.start()
    known = edge.known()
    assert "r999" in known
    assert 10 < len(known) < 200
    assert edge.journal.robot("rex").latched == LOST


def test_what_earlier_processes_left_and_what_has_just_come_is_kept_when_it_is_shortened(edge, monkeypatch):
    begun = ExecutionJournal(edge.memory / BEGUN)
    for row in (
        Latched("gone", "fire"),
        StartedCommand("rex", "of before", "land", False, edge.clock.time()),
    ):
        begun.add(row)
    begun.close()
    edge.block_folder()
    edge.start()
    rex = edge.journal.robot("rex")
    monkeypatch.setattr("fleet.host.journal.journal.LONGEST", 0)
    monkeypatch.setattr("fleet.host.journal.changes.NetChanges.shorten", lambda *_: None)
    with edge.journal._using:  # nothing is gathered meanwhile
        rex.note("just come", "land")
        rex.latch("")
        with edge.journal._adding:
            edge.journal._shorten()
    edge.kill()
    edge.unblock_folder()
    edge.start()
    assert set(edge.known()) == {"of before", "just come"}
    assert (edge.journal.robot("gone").latched, edge.journal.robot("rex").latched) == ("fire", "")


def test_commands_whose_end_is_reported_are_not_lost_by_a_later_failure(edge, monkeypatch):
    for robot in ("rex", "max"):
        edge.start().robot(robot).note("r1", "takeoff", transport="cloud")
        edge.until_written()
        edge.kill()
    edge.start()
    take = edge.journal._file.take_interrupted

    def fail(robot, now):
        if robot == "max":
            raise sqlite3.OperationalError("disk I/O error")
        return take(robot, now)

    monkeypatch.setattr(edge.journal._file, "take_interrupted", fail)
    assert [each.robot for each in edge.journal.take_interrupted(["rex", "max"])] == ["rex"]


def test_a_folder_that_takes_no_mark_harms_nothing(edge, monkeypatch):
    edge.start()
    rex = edge.journal.robot("rex")
    edge.fill_disk()
    real = os.open

    def refused(path, *rest):
        if "unwritten" in os.fspath(path):
            raise OSError(28, "No space left on device")
        return real(path, *rest)

    monkeypatch.setattr("os.open", refused)
    rex.latch("x" * 100_000)
    edge.until_failed()
    with contextlib.suppress(OSError):
        edge.free_disk()
    edge.until_written()
    assert edge.journal.robot("rex").latched
