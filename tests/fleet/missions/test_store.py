"""What is recorded of runs outlives the process."""

import queue
import sqlite3

import pytest

from fleet.missions.program import Act, Program, Wait
from fleet.missions.state import LogNote, Phase, RunHead, RunMember, RunOutcome, StepPart, UndoableStep
from fleet.missions.store import MISSIONS, RunChange, RunOrigin, RunStore

ABOUT = RunOrigin("r1", "patrol", "ab12", 1000.0, "anna", inputs={"height": 5})
PROGRAM = Program("patrol", (Wait("rest", 5.0),), {"eye": 1})
PART = StepPart("r1/up.1/kestrel/1", "up.1", "kestrel", "eye", 1, "do", Act("command", "takeoff"), 0.0, 60.0)


@pytest.fixture
def store(tmp_path):
    """Open the store of a folder, again and again; the one before is closed."""
    opened = []

    def store():
        while opened:
            opened.pop().close()
        opened.append(RunStore(tmp_path))
        return opened[-1]

    yield store
    while opened:
        opened.pop().close()


def save(store, head, touched=(), notes=(), *, new=False, run="r1"):
    """Record a change; returns whether it is on disk."""
    done = queue.Queue()
    about = ABOUT if new else None
    change = RunChange(run, head, touched, notes, 1000.0, 1.5, about, PROGRAM if new else None)
    store.save(change, done.put)
    return done.get(timeout=60)


def test_a_run_is_found_as_it_was_by_the_next_process(store):
    first = store()
    head = RunHead(Phase.STEP, at=1, undoable=[UndoableStep(0, "up.1")], loops={"0": 2})
    member = RunMember("kestrel", "eye", 0)
    assert save(first, head, [member, PART], [LogNote("takeoff begun", "kestrel", "up.1")], new=True)
    (kept,) = store().unfinished()
    assert (kept.about, kept.program, kept.head) == (ABOUT, PROGRAM, head)
    assert (kept.members, kept.parts, kept.elapsed) == ([member], [PART], 1.5)


def test_an_ended_run_is_history_with_its_story(store):
    first = store()
    save(first, RunHead(), [RunMember("kestrel", "eye", 0)], [LogNote("one")], new=True)
    save(first, RunHead(Phase.ENDED, outcome=RunOutcome.ABORTED), notes=[LogNote("two")])
    second = store()
    assert second.unfinished() == []
    results = queue.Queue()
    second.ended(10, results.put)
    ((about, head, members),) = results.get(timeout=60)
    assert (about.run, head.outcome, members[0].robot) == ("r1", RunOutcome.ABORTED, "kestrel")
    second.story("r1", results.put)
    assert [line.text for line in results.get(timeout=60)] == ["one", "two"]


def test_a_run_of_another_version_is_reported_and_keeps_no_other_from_starting(store):
    first = store()
    save(first, RunHead(), new=True)
    first._database.execute('UPDATE run SET head = \'{"phase": "flying"}\'')
    second = store()
    assert second.unfinished() == []
    assert "run r1 cannot be read" in second.lost
    assert second.problem == ""
    assert second.knows("r1")
    assert store().unfinished() == []


def test_an_ended_run_is_known(store):
    opened = store()
    save(opened, RunHead(), new=True)
    assert opened.knows("r1")
    assert not opened.has_ended("r1"), "a repeat of one under way is the same run"
    save(opened, RunHead(Phase.ENDED, outcome=RunOutcome.ABORTED))
    assert opened.has_ended("r1")
    assert opened.knows("r1")
    assert not opened.knows("r2")


def test_a_damaged_file_is_set_aside_and_reported(store, tmp_path):
    (tmp_path / MISSIONS).write_bytes(b"no database" * 1000)
    opened = store()
    assert "could not be read" in opened.lost
    assert opened.problem == ""
    assert save(opened, RunHead(), new=True)


def test_a_disk_that_takes_nothing_is_reported(store):
    opened = store()
    opened._database.close()
    opened._database = sqlite3.connect(":memory:", check_same_thread=False)  # none of our tables
    assert save(opened, RunHead(), new=True) is False
    assert "are not recorded" in opened.problem


def test_only_so_many_ended_runs_are_kept(store, monkeypatch):
    monkeypatch.setattr("fleet.missions.store.KEPT", 2)
    opened = store()
    for number in range(4):
        run = f"r{number}"
        about = RunOrigin(run, "patrol", "", 1000.0 + number)
        done = queue.Queue()
        head = RunHead(Phase.ENDED, outcome=RunOutcome.COMPLETED)
        change = RunChange(run, head, [], [LogNote("x")], 1000.0 + number, 0.0, about, PROGRAM)
        opened.save(change, done.put)
        assert done.get(timeout=60)
    results = queue.Queue()
    opened.ended(10, results.put)
    assert [about.run for about, _, _ in results.get(timeout=60)] == ["r3", "r2"]
    opened.story("r0", results.put)
    assert results.get(timeout=60) == []
