"""What another process reads of an edge's history."""

import contextlib
import sqlite3

import pytest

from fleet.errors import StateError
from fleet.history.event_filter import MOST, EventFilter
from fleet.history.reader import read
from fleet.history.record import COLUMNS, row_of
from fleet.history.store import FORMATS, HISTORY
from fleet.model.event import EventKind, EventReport


@pytest.fixture
def wrote(tmp_path):
    """Write events of robots at times into the file of an edge."""

    def wrote(*events, journal="WAL"):
        with contextlib.closing(sqlite3.connect(tmp_path / HISTORY)) as database, database:
            database.executescript(f"PRAGMA journal_mode = {journal}; {'; '.join(FORMATS)}")
            database.execute(f"PRAGMA user_version = {len(FORMATS)}")
            rows = [
                row_of(robot, EventReport(stamp, EventKind.COMMAND, f"{robot} {stamp:g}"))
                for robot, stamp in events
            ]
            marks = ", ".join("?" * len(rows[0])) if rows else ""
            database.executemany(f"INSERT INTO event ({COLUMNS}) VALUES ({marks})", rows) if rows else None
        return tmp_path

    return wrote


def texts(folder, **wanted):
    return [record.text for record in read(folder, EventFilter(**wanted))]


def test_events_are_read_the_oldest_first_whatever_order_they_were_written_in(wrote):
    assert texts(wrote(("rex", 3), ("kes", 1), ("rex", 2))) == ["kes 1", "rex 2", "rex 3"]


def test_events_of_the_same_time_are_read_as_they_were_written(wrote):
    assert texts(wrote(("b", 1), ("a", 1), ("c", 1))) == ["b 1", "a 1", "c 1"]


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ({"since": 2.0}, ["rex 2", "kes 3", "max 4"]),
        ({"since": 2.0001}, ["kes 3", "max 4"]),
        ({"robots": ("rex",)}, ["rex 1", "rex 2"]),
        ({"robots": ("rex", "max"), "since": 2.0}, ["rex 2", "max 4"]),
        ({"robots": ("none",)}, []),
        ({"robots": ("rex' OR '1'='1",)}, []),
        ({"most": 2}, ["kes 3", "max 4"]),
        ({"most": 1, "robots": ("rex",)}, ["rex 2"]),
        ({"most": 0}, ["max 4"]),
        ({"most": -5}, ["max 4"]),
    ],
)
def test_the_newest_of_the_wanted_events_are_read(wrote, wanted, found):
    assert texts(wrote(("rex", 1), ("rex", 2), ("kes", 3), ("max", 4)), **wanted) == found


def test_an_answer_is_bounded_whatever_is_wanted(wrote, monkeypatch):
    monkeypatch.setattr("fleet.history.reader.MOST", 3)
    assert len(texts(wrote(*(("rex", stamp) for stamp in range(5))), most=10**9)) == 3
    assert MOST >= 1000


def test_a_row_that_cannot_be_read_is_skipped(wrote):
    folder = wrote(("rex", 1), ("rex", 2), ("rex", 3))
    with contextlib.closing(sqlite3.connect(folder / HISTORY)) as database, database:
        database.execute("UPDATE event SET kind = 'dance' WHERE stamp = 2")
        database.execute("UPDATE event SET data = '{' WHERE stamp = 3")
    assert texts(folder) == ["rex 1"]


def test_without_a_file_or_before_its_tables_are_made_there_are_no_events(tmp_path):
    assert texts(tmp_path) == []
    assert texts(tmp_path / "none") == []
    (tmp_path / HISTORY).touch()
    assert texts(tmp_path) == []
    assert (tmp_path / HISTORY).stat().st_size == 0


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / HISTORY).write_bytes(b"rubbish" * 1000)
    with pytest.raises(StateError, match=rf"{tmp_path}/{HISTORY} cannot be read: file is not a database"):
        texts(tmp_path)


def test_a_history_of_a_newer_fleet_is_not_read(wrote):
    folder = wrote()
    with contextlib.closing(sqlite3.connect(folder / HISTORY)) as database:
        database.execute("PRAGMA user_version = 99")
    with pytest.raises(StateError, match="cannot be read: it has format 99, of a newer fleet"):
        texts(folder)


def test_reading_does_not_wait_for_an_edge_that_writes_and_changes_nothing(wrote):
    folder = wrote(("rex", 1))
    with contextlib.closing(sqlite3.connect(folder / HISTORY, isolation_level=None)) as edge:
        edge.execute("BEGIN IMMEDIATE")
        edge.execute("DELETE FROM event")
        assert texts(folder) == ["rex 1"]
        edge.execute("ROLLBACK")


def test_on_a_disk_that_cannot_be_written_the_file_is_read_as_it_is(wrote, monkeypatch):
    folder, real, places = wrote(("rex", 1)), sqlite3.connect, []

    class Unwritable(sqlite3.Connection):
        def execute(self, *_):
            raise sqlite3.OperationalError("unable to open database file")

    def connect(place, **more):
        places.append(place.rpartition("?")[2])
        return real(place, **more, factory=sqlite3.Connection if "immutable" in place else Unwritable)

    monkeypatch.setattr("fleet.history.reader.sqlite3.connect", connect)
    assert texts(folder) == ["rex 1"]
    assert places == ["mode=ro", "mode=ro&immutable=1"]
