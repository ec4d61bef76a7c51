"""What happened, kept within bounds on a disk that may be full, read-only, damaged or shared."""

import contextlib
import json
import sqlite3
import subprocess
import sys
import threading
import time

import pytest

from fleet.history.event_filter import EventFilter, newest
from fleet.history.reader import read
from fleet.history.record import LONGEST_DATA, LONGEST_TEXT
from fleet.history.store import (
    FORMATS,
    HISTORY,
    NEWEST,
    PRUNE_EVERY,
    RETRY_AFTER,
    WAITING,
    History,
    HistoryBounds,
)
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.spool.state_folder import create_folder, locked
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE

ANNA = Requester(Transport.CLOUD, "anna", "tele")


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def store(tmp_path, clock):
    history = History(tmp_path / "state", clock)
    yield history
    history.close()


def event(text="takeoff accepted", stamp=1000.0, **fields):
    return EventReport(stamp, EventKind.COMMAND, text, **fields)


def texts(history, **wanted):
    return [record.text for record in read(history.folder, EventFilter(**wanted))]


def test_an_event_is_read_as_it_was_written(store):
    said = event(
        severity=Severity.WARNING,
        asker=Requester(Transport.LOCAL, "anna", None, proven=True),
        command="takeoff",
        request="r1",
        data={"altitude": 5},
    )
    store.add("rex", said)
    store.write()
    (record,) = read(store.folder, EventFilter())
    assert (record.robot, record.stamp, record.kind, record.text) == (
        "rex",
        said.stamp,
        said.kind,
        said.text,
    )
    assert (record.severity, record.asker, record.command) == (said.severity, said.asker, said.command)
    assert (record.request, record.data) == (said.request, said.data)


def test_a_history_whose_tables_are_about_to_be_made_has_no_events(tmp_path):
    (tmp_path / HISTORY).touch()
    assert read(tmp_path, EventFilter((), 0.0, 50)) == []
    with contextlib.closing(sqlite3.connect(tmp_path / HISTORY)) as database:
        database.execute("PRAGMA journal_mode = WAL")
    assert read(tmp_path, EventFilter((), 0.0, 50)) == []


def test_events_are_found_by_robot_and_time_the_newest_of_them_in_order(store):
    for number in range(10):
        store.add(("rex", "max")[number % 2], event(str(number), stamp=float(number)))
    store.write()
    assert texts(store, robots=("rex",)) == ["0", "2", "4", "6", "8"]
    assert texts(store, since=7.0) == ["7", "8", "9"]
    assert texts(store, most=2) == ["8", "9"]


def test_what_is_not_written_yet_is_reported_too_and_once(store):
    store.add("rex", event("one", stamp=1.0))
    store.write()
    store.add("rex", event("two", stamp=2.0))
    both = newest([*read(store.folder, EventFilter()), *store.waiting(), *store.waiting()], EventFilter())
    assert [record.text for record in both] == ["one", "two"]


def test_what_others_send_is_cut_and_never_refused(store):
    store.add("r" * 10_000, event("t" * 10_000, command="c" * 10_000, data={"d": "x" * 100_000}))
    store.add("rex", event(data={"d": object()}))
    store.add("rex", event("\udce9 is no text"))
    store.write()
    long, odd, _ = read(store.folder, EventFilter())
    assert (len(long.text), len(json.dumps(long.data)) < LONGEST_DATA) == (LONGEST_TEXT, True)
    assert "left_out" in odd.data


def test_nothing_waits_for_the_disk_when_an_event_is_added(store, monkeypatch):
    monkeypatch.setattr(sqlite3, "connect", lambda *_: pytest.fail("the disk was asked"))
    store.add("rex", event())
    monkeypatch.undo()


def test_a_folder_that_cannot_be_made_keeps_events_in_memory_and_is_reported_and_tried_again(tmp_path, clock):
    (tmp_path / "state").write_text("in the way")
    store = History(tmp_path / "state", clock)
    store.add("rex", event())
    store.write()
    assert "memory only" in store.problem
    assert [record.text for record in store.waiting()] == ["takeoff accepted"]
    (tmp_path / "state").unlink()
    store.write()
    assert store.problem, "it is not tried at once"
    clock.advance(RETRY_AFTER)
    store.write()
    assert (store.problem, store.waiting(), texts(store)) == ("", [], ["takeoff accepted"])
    store.close()


def test_a_disk_that_fills_up_loses_nothing_that_memory_has_room_for(store, clock):
    store.write()
    pages = store._database.execute("PRAGMA page_count").fetchone()[0]
    store._database.execute(f"PRAGMA max_page_count = {pages}")
    for number in range(200):
        store.add("rex", event(f"{number} " + "x" * 500, stamp=float(number)))
    store.write()
    assert "full" in store.problem
    store._database.execute("PRAGMA max_page_count = 100000")
    clock.advance(RETRY_AFTER)
    store.write()
    assert (store.problem, len(texts(store))) == ("", 200)


def test_what_memory_has_no_room_for_is_counted_and_reported_when_the_disk_is_well(tmp_path, clock):
    (tmp_path / "state").write_text("in the way")
    store = History(tmp_path / "state", clock)
    for number in range(WAITING + 7):
        store.add("rex", event(str(number), stamp=clock.time() + number))
    store.write()
    assert len(store.waiting()) == WAITING
    (tmp_path / "state").unlink()
    clock.advance(RETRY_AFTER)
    store.write()
    found = texts(store, most=10_000)
    assert "7" in found
    assert "6" not in found
    assert any(text.startswith("7 events were lost") for text in found)
    store.close()


@pytest.mark.parametrize("content", [b"not a database" * 1000, b"SQLite format 3\0" + b"\xff" * 5000])
def test_a_damaged_file_is_set_aside(tmp_path, clock, content):
    (tmp_path / HISTORY).write_bytes(content)
    store = History(tmp_path, clock)
    store.add("rex", event())
    store.write()
    assert (store.problem, texts(store)) == ("", ["takeoff accepted"])
    assert (tmp_path / f"{HISTORY}.broken").exists()
    store.close()


def test_a_file_that_is_removed_under_us_is_made_anew(store, clock):
    store.add("rex", event("lost"))
    store.write()
    for path in store.folder.glob(f"{HISTORY}*"):
        path.unlink()
    store.add("rex", event("kept"))
    for _ in range(3):
        store.write()
        clock.advance(RETRY_AFTER)
    assert "kept" in texts(store)


def test_the_files_form_has_a_number(store):
    store.write()
    assert store._database.execute("PRAGMA user_version").fetchone()[0] == len(FORMATS)


def test_events_that_are_too_old_go(tmp_path, clock):
    store = History(tmp_path, clock, HistoryBounds(age=3600.0))
    now = clock.time()
    store.add("rex", event("old", stamp=now - 3601))
    for _ in range(NEWEST):
        store.add("rex", event("young", stamp=now - 3599))
    store.write()
    assert set(texts(store, most=10_000)) == {"young"}
    store.close()


def test_a_clock_that_jumps_by_years_does_not_empty_the_history(store, clock):
    store.add("rex", event("before the clock was set", stamp=7.0))
    store.write()
    clock.advance(PRUNE_EVERY)
    store.write()
    assert texts(store) == ["before the clock was set"]


def test_the_file_stays_within_its_size_and_keeps_the_newest(tmp_path, clock):
    size = 1 << 20
    store = History(tmp_path, clock, HistoryBounds(size=size))
    now = clock.time()
    for turn in range(20):
        for number in range(500):
            store.add("rex", event("x" * 400, stamp=now + turn + number / 1000, request=f"{turn}.{number}"))
        store.write()
        clock.advance(PRUNE_EVERY)
        for _ in range(4):
            store.write()
    assert (tmp_path / HISTORY).stat().st_size < 3 * size
    kept = [record.request for record in read(tmp_path, EventFilter(most=10_000))]
    assert kept[-1] == "19.499"
    assert "0.0" not in kept
    store.close()


def test_several_processes_share_the_file(tmp_path):
    script = (
        "import sys; from pathlib import Path; from fleet.clock import SystemClock; "
        "from fleet.history.store import History; from fleet.model.event import *; "
        "store = History(Path(sys.argv[1]), SystemClock())\n"
        "for number in range(200):\n"
        "    store.add(sys.argv[2], EventReport(float(number), EventKind.COMMAND, str(number)))\n"
        "    store.write()\n"
        "store.close(); sys.exit(store.problem or 0)"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", script, str(tmp_path), name]) for name in ("rex", "max")
    ]
    assert [process.wait(60) for process in started] == [0, 0]  # each may have found the other at it
    for name in ("rex", "max"):
        assert len(read(tmp_path, EventFilter(robots=(name,), most=1000))) == 200


def test_a_history_that_is_killed_loses_nothing_that_was_written(tmp_path):
    script = (
        "import os, sys; from pathlib import Path; from fleet.clock import SystemClock; "
        "from fleet.history.store import History; from fleet.model.event import *; "
        "store = History(Path(sys.argv[1]), SystemClock())\n"
        "store.add('rex', EventReport(1.0, EventKind.STOP, 'stopped')); store.write()\n"
        "os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=False)
    assert [record.text for record in read(tmp_path, EventFilter())] == ["stopped"]


def test_a_history_on_a_disk_that_takes_no_writes_is_read(tmp_path, clock):
    store = History(tmp_path / "state", clock)
    store.add("rex", event())
    store.close()
    (tmp_path / "state").chmod(0o500)
    try:
        assert texts(store) == ["takeoff accepted"]
    finally:
        (tmp_path / "state").chmod(0o700)


def test_an_event_costs_its_maker_microseconds(store):
    said = event(asker=ANNA, command="takeoff", request="r" * 32, data={"altitude": 5})
    best = min(_seconds(store, said) for _ in range(20))
    assert best < 200e-6, f"{best * 1e6:.1f} us for one event"


def _seconds(store, said):
    began = time.perf_counter()
    for _ in range(100):
        store.add("rex", said)
    return (time.perf_counter() - began) / 100


def test_a_history_that_another_process_is_opening_is_waited_for_a_moment(store, clock):
    create_folder(store.folder)
    with locked(store.folder / HISTORY):
        store.add("rex", event())
        writer = threading.Thread(target=store.write, daemon=True)
        writer.start()
        writer.join(DEADLINE / 4)
        assert not writer.is_alive()
        assert "another process is just opening" in store.problem
        clock.advance(RETRY_AFTER)
        store.write()
        assert store.problem
    clock.advance(RETRY_AFTER)
    store.write()
    assert (store.problem, texts(store)) == ("", ["takeoff accepted"])


def test_a_history_that_another_process_writes_into_is_waited_for_a_moment(store, clock):
    store.add("rex", event("one"))
    store.write()
    other = sqlite3.connect(store.folder / HISTORY, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    store.add("rex", event("two"))
    began = time.monotonic()
    store.write()
    assert time.monotonic() - began < 4.0, "SQLite itself would wait for 5 s"
    assert "locked" in store.problem
    other.execute("ROLLBACK")
    other.close()
    clock.advance(RETRY_AFTER)
    store.write()
    assert (store.problem, texts(store)) == ("", ["one", "two"])
