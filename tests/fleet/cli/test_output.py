import errno
import io
import textwrap

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cli.output import ExitCode, Output, exit_code_of, table_lines
from fleet.errors import (
    BusError,
    CloudError,
    ConfigError,
    Fault,
    LinkLost,
    NotReady,
    Refused,
    TimedOut,
    Unsupported,
)

HEADINGS = ("name", "state", "why")
ROWS = [
    ("kestrel", "ok", ""),
    ("rex", "offline", "the link fell: no heartbeat for 5 s on udpin:0.0.0.0:14550"),
]


def test_a_table_fits_a_wide_terminal():
    assert table_lines(HEADINGS, ROWS, 80) == [
        "NAME     STATE    WHY",
        "kestrel  ok",
        "rex      offline  the link fell: no heartbeat for 5 s on udpin:0.0.0.0:14550",
    ]


def test_the_last_column_wraps_between_words():
    assert table_lines(HEADINGS, ROWS, 50)[2:] == [
        "rex      offline  the link fell: no heartbeat for",
        "                  5 s on udpin:0.0.0.0:14550",
    ]


def test_on_a_narrow_terminal_each_row_is_a_block():
    assert table_lines(HEADINGS, ROWS, 40)[1:] == [
        "  state: ok",
        "rex",
        "  state: offline",
        "  why: the link fell: no heartbeat for 5",
        "    s on udpin:0.0.0.0:14550",
    ]


WORDS = st.text("abcdefgh", min_size=1, max_size=12)
CELL = st.lists(WORDS, max_size=12).map(" ".join)


@given(st.lists(st.tuples(WORDS, WORDS, CELL), min_size=1, max_size=5), st.integers(40, 200))
def test_no_line_is_too_long_and_no_word_is_lost_or_broken(rows, width):
    lines = table_lines(HEADINGS, rows, width)
    assert all(len(line) <= width for line in lines)
    shown = " ".join(lines).split()
    assert all(word in shown for row in rows for cell in row for word in cell.split())


def test_what_robots_say_cannot_steer_the_terminal():
    out = io.StringIO()
    Output(out=out).table(("a",), [("\x1b[2Jx\ny",)])
    assert out.getvalue() == "A\n\\x1b[2Jx\\ny\n"


def test_with_json_only_data_is_written():
    out = io.StringIO()
    output = Output(as_json=True, out=out)
    output.say("text")
    output.table(("a",), [("b",)])
    output.data({"a": "\x1b"})
    assert out.getvalue() == '{\n  "a": "\\u001b"\n}\n'


@pytest.mark.parametrize(("color", "line"), [(True, "rex   \x1b[32mok\x1b[0m"), (False, "rex   ok")])
def test_health_is_coloured_when_colours_are_on(color, line):
    out = io.StringIO()
    Output(color=color, out=out).table(("name", "health"), [("rex", "ok")])
    assert out.getvalue().splitlines()[1] == line


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ConfigError(""), 3),
        (TimedOut(""), 6),
        (NotReady(""), 5),
        (Refused(""), 5),
        (Unsupported(""), 5),
        (Fault(""), 5),
        (LinkLost(""), 1),
        (BusError(""), 1),
        (CloudError(""), 1),
    ],
)
def test_every_error_has_its_exit_code(error, code):
    assert exit_code_of(error) == code


def test_exit_codes_do_not_change():
    assert [code.value for code in ExitCode] == [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 130]


@pytest.mark.parametrize(
    ("terminal", "no_color", "arguments"),
    [(True, "1", []), (True, "", ["--no-color"]), (False, "", [])],
)
def test_colours_are_left_out_where_they_are_not_wanted(fleet, monkeypatch, terminal, no_color, arguments):
    monkeypatch.setattr("sys.stdout.isatty", lambda: terminal)
    monkeypatch.setenv("NO_COLOR", no_color)
    assert "\x1b[" not in fleet("adapters", *arguments).out


def test_a_terminal_gets_colours(fleet, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert "\x1b[32mloaded\x1b[0m" in fleet("adapters").out


@pytest.mark.parametrize("columns", [40, 60, 100, 200])
def test_adapters_fit_the_terminal(fleet, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    lines = fleet("adapters").out.splitlines()
    assert all(len(line) <= columns or len(line.split()) <= 2 for line in lines), textwrap.indent(
        "\n".join(lines), "|"
    )


def test_what_is_no_result_costs_nobody_anything_where_it_cannot_be_written():
    class Full(io.StringIO):
        def write(self, text):
            raise OSError(errno.ENOSPC, "No space left on device")

    Output(err=Full()).note("edge yard-1 runs")
