"""Lines of the log: for people with date and zone, for programs as JSON, and safe for a terminal."""

import logging
import sys
import time

import msgspec
import pytest

from fleet.host.logs.line_format import (
    LONGEST,
    JsonFormatter,
    LogLine,
    TextFormatter,
    as_text,
    formatter_of,
    line_of,
    local_time,
)
from fleet.host.requests.event_reporter import ROBOT_LOGGER
from fleet.runtime.event_loop import OWNER

STAMP = 1_795_867_200.1234  # 2026-11-28T12:00:00.123Z


@pytest.fixture(autouse=True)
def _zone(monkeypatch):
    """Be in a zone one hour east of UTC."""
    monkeypatch.setenv("TZ", "XYZ-1")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def record(message="it slips", name="fleet.host", **fields):
    made = logging.LogRecord(name, logging.WARNING, "file.py", 7, message, (), fields.pop("error", None))
    made.created = STAMP
    return made


def line(**fields):
    return line_of(record(**fields), JsonFormatter())


def failed():
    try:
        int("bad \x1b[2J")
    except ValueError:
        return sys.exc_info()


def test_a_time_has_milliseconds_and_the_zone_of_this_computer():
    assert local_time(STAMP) == "2026-11-28T13:00:00.123+01:00"


def test_a_line_for_people_has_time_level_and_who_says_it():
    text = TextFormatter().format(record())
    assert text == "2026-11-28T13:00:00.123+01:00 WARNING fleet.host: it slips"


def test_a_line_for_programs_is_one_json_object_without_what_is_not_known():
    text = JsonFormatter().format(record())
    assert "\n" not in text
    assert msgspec.json.decode(text) == {
        "time": "2026-11-28T13:00:00.123+01:00",
        "stamp": 1_795_867_200.123,
        "level": "WARNING",
        "logger": "fleet.host",
        "message": "it slips",
    }


@pytest.mark.parametrize(
    ("name", "owner", "robot"),
    [
        (f"{ROBOT_LOGGER}rex", "", "rex"),
        (f"{ROBOT_LOGGER}rex", "ada", "rex"),
        ("my_adapter", "ada", "ada"),
        ("fleet.host", "", ""),
    ],
)
def test_a_line_is_about_the_robot_of_its_logger_or_of_the_code_that_runs(name, owner, robot):
    token = OWNER.set(owner)
    assert line(name=name).robot == robot
    OWNER.reset(token)


def test_a_traceback_comes_along_and_its_lines_are_safe_for_a_terminal():
    found = line(error=failed())
    assert found.error.splitlines()[0] == "Traceback (most recent call last):"
    first, *rest = as_text(found).split("\n")
    assert first == "2026-11-28T13:00:00.123+01:00 WARNING fleet.host: it slips"
    assert all(each.startswith("    ") for each in rest)
    assert "ValueError: invalid literal" in rest[-1]
    assert "\x1b" not in as_text(found)


def test_a_message_cannot_fake_another_line_or_do_something_to_a_terminal():
    found = line(message="one\ntwo\x1b[2J")
    text = as_text(found)
    assert len(text.splitlines()) == 1
    assert "\x1b" not in text


@pytest.mark.parametrize("length", [LONGEST, LONGEST + 1])
def test_a_message_is_cut_to_what_a_line_bears(length):
    assert line(message="x" * length).message == "x" * LONGEST


def test_what_is_no_text_is_written_all_the_same():
    found = line(message="caf\udce9")
    assert found.message == "caf\\udce9"
    assert msgspec.json.decode(msgspec.json.encode(found), type=LogLine) == found


@pytest.mark.parametrize(("form", "kind"), [("json", JsonFormatter), ("text", TextFormatter)])
def test_each_format_has_its_formatter(form, kind):
    assert type(formatter_of(form)) is kind
