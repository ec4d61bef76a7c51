"""Parameter files are read back as they were written, also those of ground stations."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.cli import parameters
from fleet.cli.parameters import read, same, shown, written
from fleet.errors import ConfigError

names = st.text("ABC_19", min_size=1, max_size=16).map("P".__add__)
on_the_wire = st.floats(width=32, allow_nan=False, allow_infinity=False)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "rex.params"


def why(path):
    with pytest.raises(ConfigError) as error:
        read(path)
    return str(error.value)


@given(value=on_the_wire)
def test_the_text_of_a_number_is_the_same_number_on_the_wire(value):
    assert struct.pack("<f", float(shown(value))) == struct.pack("<f", value) or value == 0


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (1.0, "1"),
        (-0.0, "0"),
        (123456789.0, "123456789"),
        (struct.unpack("<f", struct.pack("<f", 0.1))[0], "0.1"),
        (0.5, "0.5"),
        (1e9, "1e+09"),
        (1e-7, "1e-07"),
    ],
)
def test_a_number_is_as_short_as_it_can_be(value, text):
    assert shown(value) == text


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        (0.1, struct.unpack("<f", struct.pack("<f", 0.1))[0], True),
        (0.1, 0.1001, False),
        (16777217.0, 16777216.0, True),
        (None, None, True),
        (None, 0.0, False),
        (0.0, None, False),
        (1e39, 1.0, False),
        (1e39, 1e39, True),
    ],
)
def test_two_values_are_equal_if_they_are_on_the_wire(one, other, equal):
    assert same(one, other) is equal


def test_a_file_is_sorted_titled_and_read_back(file):
    text = written({"B_RATE": 0.5, "A_GAIN": 3.0, "C_ODD": None}, "rex, 2026-11-28")
    assert text == "# rex, 2026-11-28\nA_GAIN 3\nB_RATE 0.5\n# C_ODD is no number\n"
    file.write_text(text)
    assert read(file) == {"A_GAIN": 3.0, "B_RATE": 0.5}


@settings(max_examples=25)
@given(values=st.dictionaries(names, on_the_wire, max_size=3))
def test_whatever_is_written_is_read_back_as_it_was(tmp_path_factory, values):
    file = tmp_path_factory.getbasetemp() / "any.params"
    file.write_text(written(values, "any"))
    found = read(file)
    assert found.keys() == values.keys()
    assert all(same(found[name], values[name]) for name in values)


@pytest.mark.parametrize(
    "line",
    ["A_GAIN 3", "A_GAIN,3", "A_GAIN\t3.0", "  A_GAIN ,  3  # why", "1 1 A_GAIN 3 9", "1\t1\tA_GAIN\t3\t6"],
)
def test_the_formats_of_ground_stations_are_read(file, line):
    file.write_text(f"# a title\n\n{line}\r\n")
    assert read(file) == {"A_GAIN": 3.0}


@pytest.mark.parametrize("line", ["A_GAIN", "A_GAIN three", "A_GAIN 3 4", "1 1 A_GAIN", "1 2 3 4 5 6"])
def test_a_line_that_is_none_is_refused_with_its_number(file, line):
    file.write_text(f"# a title\nB_RATE 1\n{line}\n")
    assert why(file) == f"{file}:3: {line!r} is not  NAME VALUE"


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999"])
def test_a_value_that_is_no_finite_number_is_refused(file, value):
    file.write_text(f"A_GAIN {value}\n")
    assert why(file) == f"{file}:1: 'A_GAIN {value}' is not  NAME VALUE"


def test_a_file_that_cannot_be_read_is_refused_with_the_reason(file, monkeypatch):
    assert why(file) == f"cannot read {file}: No such file or directory"
    file.write_bytes(b"A_GAIN \xff\n")
    assert why(file) == f"{file} is not UTF-8 text; it is no parameter file"
    monkeypatch.setattr(parameters, "_LONGEST", 10)
    file.write_text("A_GAIN 3 \n")
    assert read(file) == {"A_GAIN": 3.0}
    file.write_text("A_GAIN 3  \n")
    assert why(file) == f"{file}: longer than 10 bytes; it is no parameter file"
