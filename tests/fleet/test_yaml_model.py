"""Models of fleet.yaml: what they refuse, and their types of durations and paths."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from fleet.yaml_model import LONGEST, Duration, ExistingPath, Model, NewPath, wrong

SECONDS, NEW, EXISTING = TypeAdapter(Duration), TypeAdapter(NewPath), TypeAdapter(ExistingPath)


class Example(Model):
    speed: float = 1.0


def test_a_model_is_frozen_and_refuses_unknown_keys_and_numbers_that_are_none():
    with pytest.raises(ValidationError):
        Example().speed = 2.0
    with pytest.raises(ValidationError):
        Example(spede=1.0)
    for number in (math.nan, math.inf):
        with pytest.raises(ValidationError):
            Example(speed=number)


def test_an_error_of_a_whole_model_names_the_key_to_report_it_at():
    error = wrong("speed", "too fast: {x}")
    assert (error.message(), error.context) == ("too fast: {x}", {"reason": "too fast: {x}", "key": "speed"})


@pytest.mark.parametrize(
    ("given", "seconds"),
    [
        (5, 5.0),
        (0.25, 0.25),
        ("60 s", 60.0),
        ("60s", 60.0),
        ("12 min", 720.0),
        ("1.5 h", 5400.0),
        ("24 h", 86400.0),
        ("  2 min\n", 120.0),
        (LONGEST, 86400.0),
    ],
)
def test_a_duration_is_a_number_of_seconds_or_has_a_unit(given, seconds):
    assert SECONDS.validate_python(given) == seconds


@pytest.mark.parametrize(
    "given",
    ["60", "s", "", "1 day", "1 m", "1 ms", "-5 s", "1h30min", "1  s", "1,5 s", ".5 s", "1e3 s", "5 S"],
)
def test_what_is_no_duration_is_refused_with_how_to_write_one(given):
    with pytest.raises(ValidationError, match="is no duration: write 60 s, 12 min or 1 h"):
        SECONDS.validate_python(given)


@pytest.mark.parametrize("given", [0, -1, "0 s", LONGEST + 1, "25 h", math.nan, math.inf])
def test_a_duration_is_more_than_nothing_and_a_day_at_most(given):
    with pytest.raises(ValidationError):
        SECONDS.validate_python(given)


@given(st.integers(1, 86400))
def test_a_duration_in_seconds_means_the_same_with_and_without_its_unit(seconds):
    assert SECONDS.validate_python(f"{seconds} s") == SECONDS.validate_python(seconds) == seconds


def test_a_path_is_relative_to_the_folder_of_the_file(tmp_path, monkeypatch):
    context = {"folder": tmp_path}
    assert NEW.validate_python("a/b", context=context) == tmp_path / "a" / "b"
    assert NEW.validate_python("/etc/x", context=context) == Path("/etc/x")
    assert NEW.validate_python("a") == Path("a")
    monkeypatch.setenv("HOME", "/home/anna")
    assert NEW.validate_python("~/x", context=context) == Path("/home/anna/x")


def test_a_path_that_must_exist_does(tmp_path):
    (tmp_path / "there").touch()
    assert EXISTING.validate_python("there", context={"folder": tmp_path}) == tmp_path / "there"
    assert EXISTING.validate_python(".", context={"folder": tmp_path}) == tmp_path
    with pytest.raises(ValidationError, match=f"there is no {tmp_path}/gone"):
        EXISTING.validate_python("gone", context={"folder": tmp_path})
