"""A dead computer is replaced: its state on another one, emergency stops set, nothing half done."""

import os
import shutil
import sqlite3
import stat

import pytest

from fleet.backup import restoring
from fleet.backup.archive import BackupError
from fleet.backup.making import pack
from fleet.backup.restoring import restore
from fleet.clock import SystemClock
from fleet.config.load import sections_of
from fleet.host.journal.journal import Journal
from fleet.spool.state_folder import SPOOL, FileLock

FILE = """\
edge: {id: yard-1}
robots: [{name: rex, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: toy}]
"""


@pytest.fixture
def backup(tmp_path):
    """Make the backup of an edge whose robot rex is stopped, and let its computer die."""
    dead = tmp_path / "dead"
    dead.mkdir()
    (dead / "fleet.yaml").write_text(FILE)
    journal = Journal(dead / "state", SystemClock(), dead / "begun")
    journal.robot("rex").latch("the operator saw smoke")
    journal.robot("beast").latch("a test")
    journal.robot("beast").latch("")
    journal.close()
    file = dead / "fleet.yaml"
    packed = pack(file, sections_of(file, {}), dead / "state", {}, 1e9)
    shutil.rmtree(dead)
    return packed


def restored(backup, state, config=None, *, replace=False, contents=None):
    given = backup.contents if contents is None else contents
    return restore(backup.manifest, given, state, config, replace=replace, now=2e9)


def latches(state, tmp_path):
    """Return the emergency stops with which an edge would start from a folder."""
    journal = Journal(state, SystemClock(), tmp_path / "begun")
    try:
        return {name: journal.robot(name).latched for name in ("rex", "beast", "new-one")}
    finally:
        journal.close()


def test_a_stop_that_was_set_keeps_its_cause_and_every_other_robot_is_stopped_too(backup, tmp_path):
    restored(backup, tmp_path / "var" / "yard-1")
    found = latches(tmp_path / "var" / "yard-1", tmp_path)
    assert found["rex"] == "the operator saw smoke"
    assert "a stop may have been set since" in found["beast"]
    assert "a stop may have been set since" in found["new-one"]


def test_a_backup_without_state_stops_every_robot_too(backup, tmp_path):
    config = {name: data for name, data in backup.contents.items() if name.startswith("config/")}
    restored(backup, tmp_path / "yard-1", contents=config)
    assert all(latches(tmp_path / "yard-1", tmp_path).values())


def test_the_configuration_is_written_where_it_is_wanted_and_nobody_else_may_read_it(backup, tmp_path):
    done = restored(backup, tmp_path / "yard-1", tmp_path / "etc")
    assert (tmp_path / "etc" / "fleet.yaml").read_text() == FILE
    assert done.config == (tmp_path / "etc" / "fleet.yaml",)
    assert (tmp_path / "yard-1").stat().st_mode & 0o777 == 0o700


def test_state_that_is_there_is_refused_and_with_replace_renamed_aside(backup, tmp_path):
    restored(backup, tmp_path / "yard-1")
    with pytest.raises(BackupError, match="--replace renames it aside"):
        restored(backup, tmp_path / "yard-1")
    done = restored(backup, tmp_path / "yard-1", replace=True)
    assert done.before is not None
    assert (done.before / "journal.db").exists()


def test_a_fleet_file_that_differs_is_refused_before_anything_is_written(backup, tmp_path):
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc" / "fleet.yaml").write_text("mine")
    with pytest.raises(BackupError, match="exists and differs"):
        restored(backup, tmp_path / "yard-1", tmp_path / "etc")
    assert not (tmp_path / "yard-1").exists()
    assert (tmp_path / "etc" / "fleet.yaml").read_text() == "mine"


def test_the_state_of_an_edge_that_runs_is_not_touched(backup, tmp_path):
    restored(backup, tmp_path / "yard-1")
    edge = FileLock(tmp_path / "yard-1" / SPOOL)
    edge.acquire()
    try:
        with pytest.raises(BackupError, match="stop it first"):
            restored(backup, tmp_path / "yard-1", replace=True)
    finally:
        edge.release()
    assert [path.name for path in tmp_path.iterdir()] == ["yard-1"]


def database(version, *, broken=False):
    """Return the bytes of a state file."""
    connection = sqlite3.connect(":memory:")
    connection.execute("CREATE TABLE t (x)")
    connection.execute(f"PRAGMA user_version = {version}")
    data = connection.serialize()
    connection.close()
    return b"broken" + data[6:] if broken else data


@pytest.mark.parametrize(
    ("contents", "words"),
    [
        ({"state/journal.db": database(99)}, "has format 99"),
        ({"state/journal.db": database(0)}, "has format 0"),
        ({"state/journal.db": database(1, broken=True)}, "damaged"),
        ({"state/other.db": database(1)}, "no file of an edge's state"),
    ],
)
def test_state_that_this_fleet_cannot_use_is_refused_and_nothing_is_written(
    backup, tmp_path, contents, words
):
    with pytest.raises(BackupError, match=words):
        restored(backup, tmp_path / "yard-1", tmp_path / "etc", contents=backup.contents | contents)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_does_not_confirm_is_reported_and_the_state_is_not_said_to_be_as_it_was(
    backup, tmp_path, monkeypatch
):
    state = tmp_path / "yard-1"
    restored(backup, state)
    fsync = os.fsync

    def fails(descriptor):
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(5, os.strerror(5))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(
        BackupError, match="did not confirm it: Input/output error; the state before is"
    ) as error:
        restored(backup, state, replace=True)
    assert "as it was" not in str(error.value)
    (before,) = [path for path in tmp_path.iterdir() if path != state]
    assert str(before) in str(error.value)
    assert (state / "journal.db").exists()


@pytest.mark.parametrize("step", ["_write_all", "_into_place", "_aside"])
def test_a_restore_that_fails_in_the_middle_leaves_the_state_as_it_was(backup, tmp_path, monkeypatch, step):
    state = tmp_path / "yard-1"
    restored(backup, state)
    before = {path.name: path.read_bytes() for path in state.glob("*.db")}

    def full(*_):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(restoring, step, full)
    with pytest.raises(BackupError, match="No space left"):
        restored(backup, state, replace=True)
    assert {path.name: path.read_bytes() for path in state.glob("*.db")} == before
    assert [path.name for path in tmp_path.iterdir()] == ["yard-1"]
