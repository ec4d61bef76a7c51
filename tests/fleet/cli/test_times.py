"""Times on the command line: how far back, how long, and when, for people and for programs."""

import math
import time
from datetime import UTC, datetime

import click
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cli.times import iso, length, since, when

NOW = 1_795_867_200.0  # 2026-11-28T12:00:00Z


@pytest.fixture(autouse=True)
def zone(monkeypatch):
    """Be in a zone two hours east of UTC, at noon there."""
    monkeypatch.setenv("TZ", "XYZ-2")
    time.tzset()
    monkeypatch.setattr(time, "time", lambda: NOW)
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("30s", 30.0),
        ("5m", 300.0),
        ("5min", 300.0),
        ("1.5h", 5400.0),
        ("2d", 172_800.0),
        ("1w", 604_800.0),
        (" 10 m ", 600.0),
        ("0s", 0.0),
    ],
)
def test_a_length_of_time_is_so_far_back(text, seconds):
    assert since(None, None, text) == NOW - seconds


@pytest.mark.parametrize(
    ("text", "stamp"),
    [
        ("2026-11-28", NOW - 14 * 3600),
        ("2026-11-28T12:00", NOW - 2 * 3600),
        ("2026-11-28 12:00:00+00:00", NOW),
        ("2026-11-28T12:00:00Z", NOW),
        ("2026-11-28T11:00:00-01:00", NOW),
    ],
)
def test_a_date_is_local_unless_it_says_its_zone(text, stamp):
    assert since(None, None, text) == stamp


def test_without_a_value_everything_is_meant():
    assert since(None, None, None) == 0.0
    assert length(None, None, None) == math.inf


@pytest.mark.parametrize("text", ["", "soon", "5", "h", "-5m", "1y", "1h30m", "2026-13-01", "nan", "1e3s"])
def test_what_is_no_time_is_refused_with_examples(text):
    with pytest.raises(click.BadParameter) as error:
        since(None, None, text)
    assert error.value.message == f"{text!r} is neither like 30m, 1h, 2d nor a date like 2026-11-22"


@pytest.mark.parametrize(("text", "seconds"), [("30s", 30.0), ("10 min", 600.0), (" 0.5h ", 1800.0)])
def test_a_length_is_in_seconds_minutes_or_hours(text, seconds):
    assert length(None, None, text) == seconds


@pytest.mark.parametrize("text", ["", "5", "1d", "5m", "-1s", "inf", "1  min"])
def test_what_is_no_length_is_refused_with_examples(text):
    with pytest.raises(click.BadParameter) as error:
        length(None, None, text)
    assert error.value.message == f"{text!r} is no length of time: write 30s, 10min or 1h"


def test_a_time_is_local_for_people_and_utc_for_programs():
    assert when(NOW + 0.9) == "2026-11-28 14:00:00+02:00"
    assert iso(NOW + 0.25) == "2026-11-28T12:00:00.250+00:00"


@pytest.mark.parametrize("stamp", [math.nan, math.inf, -math.inf, 1e20, -1e20])
def test_a_time_that_is_none_is_shown_as_none(stamp):
    assert (when(stamp), iso(stamp)) == ("-", "")


@given(stamp=st.integers(0, 4_000_000_000))
def test_what_programs_read_is_the_same_time(stamp):
    assert datetime.fromisoformat(iso(stamp)) == datetime.fromtimestamp(stamp, UTC)
    assert since(None, None, when(stamp)) == stamp
