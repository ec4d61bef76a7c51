"""Extras that are missing, state of a newer fleet, and other edges with other versions or clocks."""

import sqlite3

import pytest

from fleet.doctor.finding import Rating
from fleet.doctor.software import AnsweredEdge, check_edges, check_extras, check_state
from fleet.model.state import EdgeState


def test_an_extra_that_a_link_needs_and_is_missing_is_reported_with_the_command():
    links = ["serial:/dev/ttyUSB0?baud=57600", "can:socketcan:can0", "sim:px4"]
    found = check_extras(links, lambda module: module != "serialx")
    assert [each.cure for each in found] == ["pip install 'zenoh-fleet[serial]'"]
    assert check_extras(["udpin:0.0.0.0:14550"], lambda _: False) == []


@pytest.fixture
def journal(tmp_path):
    def made(version):
        with sqlite3.connect(tmp_path / "journal.db") as database:
            database.execute(f"PRAGMA user_version = {version}")
            database.execute("CREATE TABLE IF NOT EXISTS latch (robot)")
        database.close()
        return check_state(tmp_path, {"journal.db": 2, "spool.db": 3})

    return made


def test_state_of_this_version_is_ok_and_of_a_newer_one_an_error(journal):
    assert [each.verdict for each in journal(2)] == [Rating.OK]
    (found,) = journal(3)
    assert (found.verdict, "format 3" in found.found) == (Rating.ERROR, True)


def test_a_state_file_that_is_none_is_an_error(tmp_path):
    (tmp_path / "journal.db").write_bytes(b"no database" * 100)
    (found,) = check_state(tmp_path, {"journal.db": 2})
    assert (found.verdict, "cannot be read" in found.found) == (Rating.ERROR, True)


def seen(edge, *, version="1.0", offset=0.0, doubt=0.01):
    return AnsweredEdge(EdgeState(edge, version, 0.0, 1.0), offset, doubt)


def test_edges_with_another_clock_or_version_are_reported():
    found = check_edges([seen("a"), seen("b", offset=2.0), seen("c", version="0.9")], ["d is silent"], "1.0")
    assert [(each.verdict, each.found) for each in found] == [
        (Rating.ERROR, "d is silent"),
        (Rating.OK, "a answers, version 1.0, clock +0.00 s"),
        (Rating.ERROR, "the clock of b differs by +2.0 s"),
        (Rating.WARNING, "c runs fleet 0.9, this is 1.0"),
    ]


def test_a_slow_answer_is_no_wrong_clock():
    (found,) = check_edges([seen("a", offset=0.9, doubt=0.8)], [], "1.0")
    assert found.verdict is Rating.OK
