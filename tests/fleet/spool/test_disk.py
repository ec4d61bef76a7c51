"""The disk thread of a spool: disks that fail, fill up, hang or come late, and clocks that are set."""

import contextlib
import re
import sqlite3

import pytest

from fleet.errors import StateError
from fleet.spool.database import set_aside
from fleet.spool.disk import EXPIRE_EVERY
from fleet.spool.message import Outgoing
from fleet.spool.spool import AGES
from fleet.spool.state_folder import SPOOL
from fleet.spool.store import SpoolFile
from fleet.wire.rules import TrafficClass
from tests.tools.waiting import wait_until


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    """Try a failed disk again soon."""
    monkeypatch.setattr("fleet.spool.disk.RETRY", 0.05)


def payloads(count):
    return [b"%d" % number for number in range(count)]


def test_a_disk_that_is_well_again_when_it_is_closed_gets_all_that_memory_holds(opened, monkeypatch):
    tries = []

    def no_file(*_):
        tries.append(1)
        raise StateError("no file")

    with monkeypatch.context() as ill:
        ill.setattr("fleet.spool.disk.SpoolFile", no_file)
        spool = opened().put(*payloads(20))
        wait_until("the disk was tried again", lambda: len(tries) > 1)
    spool.spool.close()
    assert opened().spool.waiting == 20


def test_a_file_with_a_row_that_no_fleet_wrote_is_set_aside(tmp_path, opened):
    first = opened().put(*payloads(3))
    first.spool.close()
    with contextlib.closing(sqlite3.connect(tmp_path / "state" / SPOOL)) as file, file:
        file.execute("UPDATE topic SET traffic = 99")
    spool = opened()
    wait_until("the file is set aside", lambda: list((tmp_path / "state").glob("*.broken")))
    spool.put(*payloads(2)).written()
    assert opened().spool.waiting == 2


def test_the_thread_of_the_disk_outlives_a_failure_and_loses_nothing(opened, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("oops")

    spool = opened()
    with monkeypatch.context() as ill:
        ill.setattr(SpoolFile, "change", fail)
        spool.put(*payloads(3))
        wait_until("the failure is told", lambda: "oops" in spool.spool.problem)
    wait_until("the disk takes them", lambda: not spool.spool.problem)
    assert opened().spool.waiting == 3


def test_a_file_that_is_damaged_under_way_is_replaced_and_memory_goes_to_the_new_one(
    tmp_path, opened, monkeypatch
):
    spool = opened().put(*payloads(10)).written()
    broken = sqlite3.DatabaseError("database disk image is malformed")
    broken.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    monkeypatch.setattr(spool.spool._disk._store, "change", lambda *_: (_ for _ in ()).throw(broken))
    spool.put(b"10")
    wait_until("it is replaced", (tmp_path / "state" / f"{SPOOL}.broken").exists)
    wait_until("all is on disk again", lambda: not spool.spool._queue.disk.unwritten)
    assert [payload for _, payload in opened().online().drain()] == payloads(11)


def test_a_damaged_file_that_cannot_be_set_aside_at_once_is_not_read_again(opened, monkeypatch):
    spool = opened().put(*payloads(10)).written()
    broken = sqlite3.DatabaseError("database disk image is malformed")
    broken.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    monkeypatch.setattr(spool.spool._disk._store, "change", lambda *_: (_ for _ in ()).throw(broken))
    busy = iter([OSError("busy")])
    monkeypatch.setattr("fleet.spool.disk.set_aside", lambda path: fail_once(busy, path))
    spool.put(b"10")
    wait_until("it cannot be moved", lambda: "busy" in spool.spool.problem)
    assert spool.online().drain() == [("t", payload) for payload in payloads(11)]
    wait_until("there is a new file", lambda: not spool.spool.problem)


def fail_once(failures, path):
    """Set a file aside, but for the first time, which fails."""
    for failure in failures:
        raise failure
    set_aside(path)


def test_a_full_disk_is_reported_costs_nothing_that_fits_in_memory_and_heals(opened):
    spool = opened(messages=1000)
    spool.spool._disk._store._database.execute("PRAGMA max_page_count = 1")
    spool.put(*[b"x" * 1000] * 100)
    wait_until("it is told", lambda: "full" in spool.spool.problem)
    assert (spool.spool.waiting, spool.spool.lost) == (100, 0)
    spool.spool._disk._store._database.execute("PRAGMA max_page_count = 10000")
    wait_until("it heals", lambda: not spool.spool.problem)
    spool.written()
    assert opened().spool.waiting == 100


def test_a_folder_that_cannot_be_written_is_reported_and_memory_serves(tmp_path, opened):
    (tmp_path / "state" / SPOOL).mkdir(parents=True)
    spool = opened()
    assert "cannot be used" in spool.spool.problem
    spool.put(b"0")
    assert spool.online().drain() == [("t", b"0")]


def test_beyond_the_memory_without_a_file_the_newest_are_sent_and_the_others_reported(tmp_path, opened):
    (tmp_path / "state" / SPOOL).mkdir(parents=True)
    spool = opened(messages=10).put(*payloads(15)).online()
    assert [payload for _, payload in spool.drain()] == payloads(15)[5:]
    assert spool.spool.lost == 5
    assert spool.put(b"more").drain() == [("t", b"more")]


def test_what_waits_while_the_file_cannot_be_replaced_is_sent_from_memory(opened, clock, monkeypatch):
    spool = opened(messages=10)
    broken = sqlite3.DatabaseError("database disk image is malformed")
    broken.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    monkeypatch.setattr(spool.spool._disk._store, "change", lambda *_: (_ for _ in ()).throw(broken))
    monkeypatch.setattr("fleet.spool.disk.SpoolFile", lambda *_: (_ for _ in ()).throw(StateError("no file")))
    with spool.spool._queue_lock:  # they come faster than the disk is looked at
        for payload in payloads(15):
            spool.spool._queue.put(Outgoing("t", payload, 1), clock.monotonic(), clock.time())
    spool.online()
    assert [payload for _, payload in spool.drain()] == payloads(15)


def test_a_folder_that_cannot_be_made_is_reported_and_memory_serves_until_it_can(tmp_path, opened):
    (tmp_path / "file").write_text("")
    spool = opened(tmp_path / "file" / "state")
    assert re.search(r"cannot create .*file/state.*set edge\.spool\.path", spool.spool.problem)
    spool.put(*payloads(3)).online()
    assert [payload for _, payload in spool.drain()] == payloads(3)
    (tmp_path / "file").unlink()
    spool.spool._disk._wake.set()
    wait_until("the folder is used", lambda: spool.spool._disk._store is not None)


def test_a_lock_that_cannot_be_opened_is_reported_and_memory_serves(tmp_path, opened):
    (tmp_path / "state" / "spool.db.lock").mkdir(parents=True)
    spool = opened(tmp_path / "state")
    assert "cannot open" in spool.spool.problem
    spool.put(*payloads(3)).online()
    assert [payload for _, payload in spool.drain()] == payloads(3)


def test_nobody_waits_for_a_disk_that_hangs(opened):
    spool = opened()
    with sqlite3.connect(spool.spool._disk._store.path, isolation_level=None) as other:
        other.execute("BEGIN EXCLUSIVE")
        spool.put(*payloads(100)).online()
        spool.send()
        assert [payload for _, payload in spool.send()] == payloads(100)[1:]
    other.close()


@pytest.mark.parametrize("step", [AGES[TrafficClass.EVENT] + 3600, -365 * 86400])
def test_a_clock_that_is_set_right_makes_nothing_older_or_younger(opened, clock, step):
    spool = opened(messages=8)
    for payload in payloads(20):
        spool.put(payload).written()
    with spool.spool._queue_lock:  # the disk hears of the last only after the step
        spool.spool._queue.put(Outgoing("t", b"20", 1), clock.monotonic(), clock.time())
        clock.step(step)
    clock.advance(EXPIRE_EVERY)
    spool.spool.tick()
    spool.written()
    clock.advance(AGES[TrafficClass.EVENT] - EXPIRE_EVERY - 60)
    spool.spool.tick()
    assert [payload for _, payload in spool.online().drain()] == payloads(21)


def test_what_an_earlier_process_left_is_as_old_as_the_clock_says(opened, clock):
    opened().put(*payloads(3)).written()
    spool = opened()
    clock.step(AGES[TrafficClass.EVENT])
    clock.advance(EXPIRE_EVERY)
    spool.put(b"new").written()
    assert spool.online().drain() == [("t", b"new")]


@pytest.mark.parametrize("step", [7200, -365 * 86400])
def test_what_waits_grows_too_old_in_its_time_though_the_clock_was_set(opened, clock, step):
    spool = opened(messages=8)
    for payload in payloads(20):
        spool.put(payload).written()
    clock.step(step)
    clock.advance(AGES[TrafficClass.EVENT])
    spool.put(b"new").written()
    assert spool.online().drain() == [("t", b"new")]
