"""What another process reads of a spool, whatever state its file is in."""

import contextlib
import os
import sqlite3

import pytest

from fleet.errors import StateError, StateTaken
from fleet.spool.inspection import (
    QueuedMessage,
    TopicBacklog,
    backlog,
    in_use,
    messages,
    purge,
    unreported_losses,
)
from fleet.spool.losses import Gap, Reason
from fleet.spool.message import Outgoing
from fleet.spool.state_folder import SPOOL, FileLock
from fleet.spool.store import SpoolFile
from fleet.wire.rules import TrafficClass

REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT
LOSSES = [Gap("a", Reason.ROOM, 2, 1.0, 2.0), Gap("t", Reason.AGE, 3, 1.5, 9.0)]
READERS = [backlog, unreported_losses, lambda folder: list(messages(folder))]


def message(seq, topic, traffic, payload, expires):
    return Outgoing(topic, payload, 1, traffic, seq=seq, expires=expires)


@pytest.fixture
def store(tmp_path):
    """Fill the file of a spool, which stays open, as while an edge runs."""
    store = SpoolFile(tmp_path / SPOOL, 1024 * 1024)
    rows = [
        message(4, "t", EVENT, b"12345", 70.0),
        message(2, "t", EVENT, b"\xff", 50.0),
        message(3, "z", REPLY, b"", 60.0),
        message(1, "b", STATUS, b"1", 80.0),
        message(5, "a", STATUS, b"22", 90.0),
    ]
    store.change(rows, [], reversed(LOSSES))
    yield store
    store.close()


@pytest.fixture
def lock(tmp_path):
    """Hold the lock of a running edge."""
    lock = FileLock(tmp_path / SPOOL)
    lock.acquire()
    yield lock
    lock.release()


def test_what_waits_is_told_by_topic_the_most_important_class_first(tmp_path, store):
    assert backlog(tmp_path) == [
        TopicBacklog("z", "reply", 1, 0, 60.0),
        TopicBacklog("a", "status", 1, 2, 90.0),
        TopicBacklog("b", "status", 1, 1, 80.0),
        TopicBacklog("t", "event", 2, 6, 50.0),
    ]


def test_messages_are_told_the_oldest_first(tmp_path, store):
    found = list(messages(tmp_path))
    assert [each.seq for each in found] == [1, 2, 3, 4, 5]
    assert found[1] == QueuedMessage(2, "t", "event", 50.0, b"\xff")
    assert found[2] == QueuedMessage(3, "z", "reply", 60.0, b"")


def test_losses_are_told_by_topic(tmp_path, store):
    assert unreported_losses(tmp_path) == LOSSES


def test_reading_changes_nothing(tmp_path, store):
    for reader in READERS:
        reader(tmp_path)
    assert (len(store.left()), len(store.losses())) == (4, 2)


@pytest.mark.parametrize("there", ["no folder", "no file", "no bytes"])
@pytest.mark.parametrize("reader", READERS)
def test_a_spool_that_was_never_written_is_empty(tmp_path, there, reader):
    folder = tmp_path / "state"
    if there != "no folder":
        folder.mkdir()
    if there == "no bytes":
        (folder / SPOOL).touch()
    assert reader(folder) == []
    assert (folder / SPOOL).exists() is (there == "no bytes")
    assert folder.exists() is (there != "no folder")


@pytest.mark.parametrize("reader", [*READERS, purge])
def test_a_file_that_is_no_spool_is_named_with_what_is_wrong(tmp_path, reader):
    (tmp_path / SPOOL).write_bytes(b"rubbish" * 1000)
    with pytest.raises(StateError, match=rf"{tmp_path}/{SPOOL} cannot be read: file is not a database"):
        reader(tmp_path)


def test_a_file_without_the_tables_of_a_spool_is_named(tmp_path):
    with contextlib.closing(sqlite3.connect(tmp_path / SPOOL)) as other:
        other.executescript("CREATE TABLE other (x); PRAGMA user_version = 1")
    with pytest.raises(StateError, match="cannot be read: no such table"):
        backlog(tmp_path)


@pytest.mark.parametrize("reader", [*READERS, purge])
def test_a_file_of_a_newer_fleet_is_not_touched(tmp_path, store, reader):
    store._database.execute("PRAGMA user_version = 7")
    with pytest.raises(StateError, match="cannot be read: it has format 7, of a newer fleet"):
        reader(tmp_path)
    assert len(store.left()) == 4


def test_a_purged_spool_has_neither_messages_nor_losses_and_can_be_filled_again(tmp_path, store):
    store.close()
    size = (tmp_path / SPOOL).stat().st_size
    assert purge(tmp_path) == 5
    assert (backlog(tmp_path), unreported_losses(tmp_path)) == ([], [])
    assert (tmp_path / SPOOL).stat().st_size <= size
    assert purge(tmp_path) == 0
    assert not in_use(tmp_path)


def test_a_purged_spool_leaves_nothing_of_its_messages_on_disk(tmp_path, store):
    store.change([message(9, "t", EVENT, b"precious" * 4000, 1.0)], [])
    store.close()
    before = (tmp_path / SPOOL).stat().st_size
    purge(tmp_path)
    assert b"precious" not in (tmp_path / SPOOL).read_bytes()
    assert (tmp_path / SPOOL).stat().st_size < before


def test_nothing_is_made_to_purge_a_spool_that_was_never_written(tmp_path):
    assert purge(tmp_path) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_spool_is_not_purged_while_its_edge_runs(tmp_path, store, lock):
    with pytest.raises(StateTaken, match=rf"another running edge \(process {os.getpid()}\)"):
        purge(tmp_path)
    assert len(store.left()) == 4


def test_the_lock_is_released_also_when_the_file_cannot_be_purged(tmp_path):
    (tmp_path / SPOOL).write_bytes(b"rubbish" * 1000)
    with pytest.raises(StateError):
        purge(tmp_path)
    assert not in_use(tmp_path)


def test_a_spool_is_in_use_while_an_edge_holds_its_lock(tmp_path, lock):
    assert in_use(tmp_path)
    lock.release()
    assert not in_use(tmp_path)
    lock.acquire()  # asking keeps no lock


def test_a_spool_is_unused_without_its_folder_or_when_no_lock_can_be_made(tmp_path):
    assert not in_use(tmp_path / "none")
    assert not (tmp_path / "none").exists()
    (tmp_path / f"{SPOOL}.lock").mkdir()
    assert not in_use(tmp_path)


class WithoutIndex:
    """A connection on a disk that has no room for an index."""

    def execute(self, statement):
        raise sqlite3.OperationalError("unable to open database file")

    def close(self):
        pass


@pytest.fixture
def full_disk(monkeypatch):
    real = sqlite3.connect

    def connect(place, **more):
        return WithoutIndex() if "mode=" in place else real(place, **more)

    monkeypatch.setattr("fleet.spool.inspection.sqlite3.connect", connect)


def test_on_a_full_disk_a_file_is_read_without_an_index(tmp_path, store, full_disk):
    store.close()
    assert len(backlog(tmp_path)) == 4
    (tmp_path / f"{SPOOL}-wal").touch()
    assert len(backlog(tmp_path)) == 4


def test_changes_that_need_an_index_are_not_left_out_on_a_full_disk(tmp_path, store, full_disk):
    assert (tmp_path / f"{SPOOL}-wal").stat().st_size > 0
    with pytest.raises(StateError, match="unable to open database file; is its disk full"):
        backlog(tmp_path)
