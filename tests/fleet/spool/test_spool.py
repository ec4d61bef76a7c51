"""The spool on a real disk: violent deaths, full disks, damaged files, two edges; and what is told."""

import contextlib
import os
import re
import signal
import sqlite3
import subprocess
import sys

import pytest

from fleet.clock import SystemClock
from fleet.errors import StateError
from fleet.spool.database import set_aside
from fleet.spool.disk import EXPIRE_EVERY
from fleet.spool.losses import Reason
from fleet.spool.message import Outgoing
from fleet.spool.spool import AGES
from fleet.spool.state_folder import SPOOL
from fleet.spool.store import LEAST_EVICTED, SpoolFile
from fleet.spool.unwritten import MOST_ROWS
from fleet.wire.rules import TrafficClass
from tests.tools.waiting import wait_until

KILLED = """
import os, signal, sys
from pathlib import Path
from fleet.clock import SystemClock
from fleet.spool.message import Outgoing
from fleet.spool.spool import Spool, SpoolSettings

spool = Spool(SpoolSettings(folder=Path(sys.argv[1])), SystemClock())
told = 0
for number in range(1_000_000):
    spool.put(Outgoing(f"t/{number % 3}", b"%d" % number, 1))
    if number % 500 == 499:
        while spool._queue.disk.unwritten:
            pass
        print(number, flush=True)
"""


def payloads(count):
    return [b"%d" % number for number in range(count)]


def test_what_waits_outlives_the_process(opened):
    opened().put(*payloads(10)).spool.close()
    later = opened()
    assert later.spool.waiting == 10
    assert [payload for _, payload in later.online().drain()] == payloads(10)
    assert opened().spool.waiting == 0


def test_all_that_was_taken_is_on_disk_when_it_is_closed(opened):
    count = 2 * MOST_ROWS + 10
    opened().online().put(*payloads(count)).spool.close()
    assert opened().spool.waiting == count


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


def test_a_killed_process_loses_nothing_that_was_on_disk_and_keeps_the_order(tmp_path, opened):
    command = [sys.executable, "-c", KILLED, tmp_path / "state"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as dying:
        for _ in range(4):
            on_disk = int(dying.stdout.readline())
        dying.kill()
    assert dying.returncode == -signal.SIGKILL
    spool = opened(clock=SystemClock())
    spool.spool.go_online()
    sent = spool.drain()
    for part in range(3):
        numbers = [int(payload) for topic, payload in sent if topic == f"t/{part}"]
        assert numbers == list(range(part, part + 3 * len(numbers), 3))
        assert numbers[-1] >= on_disk - 3


def test_what_the_cloud_took_is_not_sent_again_after_a_restart(opened):
    first = opened().put(*payloads(10)).written().online()
    first.send()
    first.send()
    first.written()
    assert opened().spool.waiting == 0


def test_more_than_fits_in_memory_waits_on_disk_and_memory_stays_flat(opened):
    spool = opened(messages=50)
    for number in range(2000):
        spool.put(b"%d" % number, topic=f"t/{number % 4}")
        if number % 50 == 0:
            spool.written()
    spool.written()
    assert spool.spool._queue._memory.count <= 50
    assert spool.spool.figures().classes[TrafficClass.EVENT].on_disk == 1950
    sent = spool.online().drain()
    for part in range(4):
        assert [int(payload) for topic, payload in sent if topic == f"t/{part}"] == [*range(part, 2000, 4)]


def test_its_size_is_bounded_and_what_matters_least_goes_first_and_is_reported(tmp_path, opened):
    size = 1024 * 1024
    spool = opened(size=size, messages=200)
    spool.put(*[b"s" * 1000] * 100, topic="status", traffic=TrafficClass.STATUS).written()
    for _ in range(40):
        spool.put(*[b"e" * 1000] * 100, topic="event").written()
    assert (tmp_path / "state" / SPOOL).stat().st_size <= size
    assert spool.spool.problem == ""
    gaps = {(gap.topic, gap.reason): gap.lost for gap in spool.spool.take_gaps()}
    assert set(gaps) == {("event", Reason.ROOM)}
    kept = opened(size=size).online().drain()
    assert sum(topic == "status" for topic, _ in kept) == 100
    assert sum(topic == "event" for topic, _ in kept) == 4000 - gaps["event", Reason.ROOM]


def test_losses_that_are_not_reported_yet_outlive_the_process(opened, clock):
    spool = opened().put(b"0", b"1")
    clock.advance(AGES[TrafficClass.EVENT])
    spool.spool.tick()
    assert spool.written().spool.lost == 2
    spool = opened()
    (gap,) = spool.spool.take_gaps()
    assert (gap.topic, gap.reason, gap.lost) == ("t", Reason.AGE, 2)
    spool.written()
    assert opened().spool.take_gaps() == []


def test_what_grew_too_old_while_nothing_ran_is_dropped_and_reported(opened, clock):
    opened().put(*payloads(20)).put(b"young", topic="u").written()
    clock.advance(AGES[TrafficClass.EVENT])
    spool = opened().put(b"new").online()
    clock.advance(EXPIRE_EVERY)
    assert spool.drain() == [("t", b"new")]
    spool.spool.tick()
    lost = {gap.topic: gap.lost for gap in spool.spool.take_gaps()}
    assert lost == {"t": 20, "u": 1}


@pytest.mark.parametrize("damage", ["rubbish", "cut", "no format of ours"])
def test_a_file_that_cannot_be_read_is_set_aside_and_reported(tmp_path, opened, damage):
    opened().put(*payloads(500)).written().spool.close()
    path = tmp_path / "state" / SPOOL
    if damage == "rubbish":
        path.write_bytes(b"rubbish" * 1000)
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:-10_000])
    else:
        with sqlite3.connect(path) as other:
            other.execute("PRAGMA user_version = -1")
        other.close()
    spool = opened()
    assert spool.spool.problem == f"{SPOOL} could not be read and was set aside as {SPOOL}.broken"
    assert (tmp_path / "state" / f"{SPOOL}.broken").exists()
    spool.put(b"new").written()
    wait_until("it is well again", lambda: not spool.spool.problem)
    assert spool.online().drain() == [("t", b"new")]


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


def test_two_edges_do_not_share_a_folder(tmp_path, opened):
    first = opened()
    with pytest.raises(StateError, match=f"another running edge \\(process {os.getpid()}\\)"):
        type(first)(tmp_path / "state", first.clock)


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


def test_its_figures_say_what_waits_of_each_class_since_when_also_from_before(opened, clock):
    began = clock.time()
    opened().put(b"old", traffic=TrafficClass.STATUS, topic="s").written()
    clock.advance(100.0)
    spool = opened()
    spool.put(b"young", b"younger").written()
    figures = spool.spool.figures()
    status, event = figures.classes[TrafficClass.STATUS], figures.classes[TrafficClass.EVENT]
    assert (status.messages, status.on_disk, event.messages, event.on_disk) == (1, 1, 2, 0)
    assert (status.oldest, event.oldest) == pytest.approx((began, began + 100.0), abs=0.001)
    assert event.memory == len(b"youngyounger")
    assert figures.classes[TrafficClass.REPLY].oldest is None
    assert 0 < figures.disk < 1_000_000


def test_making_room_does_not_read_all_that_waits(tmp_path):
    steps = {}
    for count in (1000, 8000):
        store = SpoolFile(tmp_path / str(count), 64 * 1024 * 1024)
        rows = [
            Outgoing(f"t/{n % 5}", b"", 1, TrafficClass.STATUS, expires=1e12, seq=n)
            for n in range(1, count + 1)
        ]
        store.change(rows, [])
        seen = steps[count] = []
        store._database.set_progress_handler(lambda seen=seen: seen.append(1), 100)
        assert [seq for seq, _ in store._oldest()] == list(range(1, LEAST_EVICTED + 1))
        store.close()
    assert len(steps[8000]) < 2 * len(steps[1000])


def test_room_is_made_in_parts_however_large_the_file_is(tmp_path):
    store = SpoolFile(tmp_path / "spool", 4 * 1024 * 1024)
    seqs = range(1, 4001)
    with contextlib.closing(store):
        for start in range(0, 4000, 100):
            rows = [
                Outgoing("t", bytes(800), 1, TrafficClass.EVENT, expires=9e9, seq=seq)
                for seq in seqs[start : start + 100]
            ]
            store.change(rows, [])
        parts = list(store.evict(300_000))
        assert store.room(300_000)
    assert len(parts) > 1
    assert max(map(len, parts)) <= LEAST_EVICTED
    assert [seq for part in parts for _, seq in part] == list(seqs[: sum(map(len, parts))])
