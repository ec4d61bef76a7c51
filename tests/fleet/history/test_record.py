"""An event as a row of the history: complete, and within bounds whatever an adapter puts into it."""

import sqlite3

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.history.record import COLUMNS, LONGEST_DATA, LONGEST_NAME, LONGEST_TEXT, Record, record_of, row_of
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity

ANNA = Requester(Transport.LOCAL, "anna", "tele", proven=True)
WORDS = st.text(max_size=20)


def event(text="it moved", **more):
    return EventReport(1000.5, EventKind.COMMAND, text, **more)


def test_a_row_has_a_value_for_each_column():
    assert len(row_of("rex", event())) == len(COLUMNS.split(", "))


def test_an_event_comes_back_with_everything_it_had():
    said = event(severity=Severity.ERROR, asker=ANNA, command="move", request="r1", data={"x": [1, None]})
    assert record_of(row_of("rex", said)) == Record(
        1000.5, "rex", EventKind.COMMAND, "it moved", Severity.ERROR, ANNA, "move", "r1", {"x": [1, None]}
    )


def test_an_event_that_nobody_asked_for_has_no_requester():
    record = record_of(row_of("", event()))
    assert (record.asker, record.command, record.request, record.data, record.edge) == (None, "", "", {}, "")


def test_a_requester_without_a_name_or_a_source_is_a_requester():
    for asker in (Requester(Transport.CLOUD), Requester(Transport.BUS, "", None, proven=True)):
        assert record_of(row_of("rex", event(asker=asker))).asker == asker


@given(WORDS, WORDS, WORDS, WORDS, st.dictionaries(WORDS, st.integers() | WORDS, max_size=3))
def test_any_event_is_a_row_that_sqlite_takes_and_gives_back(robot, text, name, request, data):
    row = row_of(robot, event(text, asker=Requester(Transport.BUS, name), request=request, data=data))
    marks = ", ".join("?" * len(row))
    database = sqlite3.connect(":memory:")
    (stored,) = database.execute(f"SELECT {marks}", row)
    database.close()
    record = record_of(stored)
    assert (record.robot, record.text, record.request) == (robot, text, request)
    assert record.asker == Requester(Transport.BUS, name)
    assert record.data == data


@pytest.mark.parametrize("field", ["text", "command", "request"])
def test_long_texts_are_cut(field):
    longest = LONGEST_TEXT if field == "text" else LONGEST_NAME
    for size in (longest, longest + 1, 10**5):
        record = record_of(row_of("rex", event(**{field: "x" * size})))
        assert getattr(record, field) == "x" * longest


def test_long_names_are_cut():
    asker = Requester(Transport.BUS, "a" * 500, "s" * 500)
    record = record_of(row_of("r" * 500, event(asker=asker)))
    assert (record.robot, record.asker.name, record.asker.source_type) == (
        "r" * LONGEST_NAME,
        "a" * LONGEST_NAME,
        "s" * LONGEST_NAME,
    )


def test_half_a_character_costs_no_event():
    asker = Requester(Transport.BUS, "\ud800a", "\udc00")
    record = record_of(row_of("\ud800", event("b\ud800\u00e4", asker=asker)))
    assert (record.robot, record.text, record.asker.name) == ("?", "b?\u00e4", "?a")


@pytest.mark.parametrize("data", [{"x": object()}, {"x": "\ud800"}, {1: {2, object()}}, {"x": {(1, 2): 3}}])
def test_data_that_is_no_json_is_left_out_and_says_so(data):
    assert record_of(row_of("rex", event(data=data))).data == {"left_out": "it is no JSON"}


def test_large_data_is_left_out_and_says_how_large_it_was():
    fits = {"x": "y" * (LONGEST_DATA - len('{"x":""}'))}
    assert record_of(row_of("rex", event(data=fits))).data == fits
    large = {"x": fits["x"] + "y"}
    assert record_of(row_of("rex", event(data=large))).data == {"left_out": f"{LONGEST_DATA + 1} bytes"}


ROW = row_of("rex", event(asker=ANNA, data={"x": 1}))


@pytest.mark.parametrize(
    ("column", "value"),
    [(2, "dance"), (3, "loud"), (5, "pigeon"), (11, "[1]"), (11, "{"), (11, "\ud800")],
)
def test_an_invalid_row_is_a_value_error(column, value):
    with pytest.raises(ValueError):
        record_of((*ROW[:column], value, *ROW[column + 1 :]))
