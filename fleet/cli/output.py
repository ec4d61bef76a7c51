"""Shared by all commands: exit codes, results on stdout, notes on stderr, tables, JSON, colours."""

from __future__ import annotations

import contextlib
import enum
import functools
import json
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TextIO

import click

from fleet.config.text import printable
from fleet.errors import CommandError, ConfigError, FleetError, NotRunning, TimedOut

GAP = "  "
_TO_THE_TOP = "\x1b[H"  # ANSI: cursor home, erase to end of line, erase to end of screen
_TO_ITS_END = "\x1b[K"
_TO_THE_END = "\x1b[J"
NARROWEST_TEXT = 24  # a narrower last column is shown below, not beside


class ExitCode(enum.IntEnum):
    """How a command ended; numbers are defined only here."""

    OK = 0
    RUNTIME_ERROR = 1
    USAGE = 2  # the command line is invalid
    CONFIG_INVALID = 3  # fleet.yaml cannot be used
    NOT_RUNNING = 4  # no edge answers
    REJECTED = 5  # refused by the host or the robot
    TIMEOUT = 6  # the robot did not answer in time
    SOME_FAILED = 7  # some of several robots failed
    ENDED = 8  # a mission ended without being completed
    UNKNOWN = 9  # the outcome of a mission is unknown
    INTERRUPTED = 130  # Ctrl-C


_EXIT_OF: Mapping[type[FleetError], ExitCode] = {
    ConfigError: ExitCode.CONFIG_INVALID,
    NotRunning: ExitCode.NOT_RUNNING,
    TimedOut: ExitCode.TIMEOUT,
    CommandError: ExitCode.REJECTED,
}


def exit_code_of(error: FleetError) -> ExitCode:
    """Return the exit code of an error, by its most specific class."""
    codes = (_EXIT_OF[kind] for kind in type(error).__mro__ if kind in _EXIT_OF)
    return next(codes, ExitCode.RUNTIME_ERROR)


def show_error(error: FleetError) -> None:
    """Write an error to stderr; errors in a fleet file with their line and a caret."""
    problems = getattr(error, "problems", ())
    for problem in problems:
        sys.stderr.write(f"{problem.shown()}\n")
    if problems:
        sys.stderr.write(f"fleet: {counted(len(problems), 'problem')}\n")
    else:
        sys.stderr.write(f"fleet: {printable(str(error))}\n")


def counted(number: int, word: str) -> str:
    """Return ``1 robot`` or ``2 robots``."""
    return f"{number} {word}{'' if number == 1 else 's'}"


_WORSE = (ExitCode.TIMEOUT, ExitCode.REJECTED)
"""Failures of one robot, worst first: without an answer its state is unknown."""
_TOGETHER = {ExitCode.OK: "ok", ExitCode.REJECTED: "refused or failed", ExitCode.TIMEOUT: "not known"}


def summarise_answers(out: Output, answered: Sequence[tuple[str, ExitCode]]) -> ExitCode:
    """Summarise the answers of several robots on one line; return the common exit code.

    All equal: that code; some ok: 7; none ok: the worst. A single robot gets no such line.
    """
    by_code: dict[ExitCode, list[str]] = {}
    for name, code in answered:
        by_code.setdefault(code, []).append(name)
    if len(answered) > 1:
        parts = [f"{len(by_code.get(ExitCode.OK, ()))} of {len(answered)} ok"]
        parts += [f"{_TOGETHER[code]}: {', '.join(by_code[code])}" for code in _WORSE if code in by_code]
        out.note("; ".join(parts))
    if len(by_code) <= 1:
        return next(iter(by_code), ExitCode.OK)
    if ExitCode.OK in by_code:
        return ExitCode.SOME_FAILED
    return next(code for code in _WORSE if code in by_code)


class Output:
    """Output of one command. With ``as_json``, only ``data`` writes to stdout."""

    def __init__(
        self,
        *,
        as_json: bool = False,
        color: bool = False,
        width: int = 80,
        height: int | None = None,
        out: TextIO | None = None,
        err: TextIO | None = None,
    ) -> None:
        self.as_json = as_json
        self.color = color
        self._width = width
        self._height = height
        self._out = out or sys.stdout
        self._err = err or sys.stderr

    @property
    def width(self) -> int | None:
        """The columns of the terminal; None if the output is none."""
        return self._width if self.height is not None else None

    @property
    def height(self) -> int | None:
        """The lines of the terminal; None if the output is none."""
        return self._height

    def say(self, text: str) -> None:
        """Write a line of a result for people."""
        if not self.as_json:
            self._out.write(f"{printable(text)}\n")

    def note(self, text: str) -> None:
        """Write a note to stderr; an error there (full disk, no reader) must not stop the robots."""
        with contextlib.suppress(OSError):
            self._err.write(f"{printable(text)}\n")

    def data(self, value: object) -> None:
        """Write the result for programs, as one JSON document."""
        if self.as_json:
            self._out.write(json.dumps(value, indent=2, default=str) + "\n")

    def table(self, headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
        """Write rows for people; see ``table_lines``."""
        if not self.as_json:
            lines = table_lines(headings, list(rows), self._width)
            self._out.write("".join(f"{self.colored(line)}\n" for line in lines))

    def lines(self, lines: Iterable[str]) -> None:
        """Write lines for people that are printable and fit."""
        if not self.as_json:
            self._out.write("".join(f"{self.colored(line)}\n" for line in lines))

    def screen(self, lines: Iterable[str]) -> None:
        """Replace the previous lines on a terminal; otherwise append them."""
        if self.height is None:
            self.lines([*lines, ""])
        else:
            drawn = "".join(f"{self.colored(line)}{_TO_ITS_END}\n" for line in lines)
            self._out.write(f"{_TO_THE_TOP}{drawn}{_TO_THE_END}")
        self._out.flush()

    def line(self, text: str) -> None:
        """Write one line for programs, at once."""
        self._out.write(f"{text}\n")
        self._out.flush()

    def colored(self, line: str) -> str:
        """Return a line with the words of ``COLORS`` coloured, if colours are on."""
        if not self.color:
            return line
        return " ".join(
            click.style(word, fg=COLORS[word]) if word in COLORS else word for word in line.split(" ")
        )


COLORS = {
    "ok": "green",
    "loaded": "green",
    "degraded": "yellow",
    "offline": "red",
    "fault": "red",
    "failed": "red",
}


def with_output(function: Callable[..., object]) -> Callable[..., object]:
    """Add the options --json and --no-color, and pass an Output as the first argument."""

    @click.option("--json", "as_json", is_flag=True, help="Print one JSON document for programs.")
    @click.option("--no-color", is_flag=True, help="Print without colours (as NO_COLOR=1 does).")
    @functools.wraps(function)
    def command(*args: object, as_json: bool, no_color: bool, **options: object) -> object:
        terminal = sys.stdout.isatty()
        color = terminal and not (no_color or os.environ.get("NO_COLOR"))
        width, height = shutil.get_terminal_size()
        out = Output(as_json=as_json, color=color, width=width, height=height if terminal else None)
        return function(out, *args, **options)

    return command


def table_lines(headings: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[str]:
    """Return the lines of a table that fits ``width`` columns.

    The last column takes the remaining width and wraps between words. If that is too narrow, each row becomes
    a block of  ``heading: value``  lines. A single word longer than the line stays whole.
    """
    cells = [[printable(cell) for cell in row] for row in rows]
    columns = list(zip(headings, *cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    before = sum(widths[:-1]) + len(GAP) * (len(widths) - 1)
    if before + widths[-1] > width and width - before < NARROWEST_TEXT:
        return [line for row in cells for line in _block(headings, row, width)]
    room = max(width - before, 1)
    table = [[heading.upper() for heading in headings], *cells]
    return [line for row in table for line in _row(row, widths, room)]


def _row(row: Sequence[str], widths: Sequence[int], room: int) -> list[str]:
    """Return one row of a table; the last cell wrapped into ``room`` columns."""
    first = "".join(f"{cell:<{size}}{GAP}" for cell, size in zip(row[:-1], widths[:-1], strict=True))
    parts = _wrapped(row[-1], room)
    return [f"{first if index == 0 else ' ' * len(first)}{part}".rstrip() for index, part in enumerate(parts)]


def _block(headings: Sequence[str], row: Sequence[str], width: int) -> list[str]:
    """Return one row as lines of ``heading: value``, the first cell as the title."""
    lines = [row[0]]
    for heading, cell in zip(headings[1:], row[1:], strict=True):
        if cell:
            first, *rest = _wrapped(f"{heading}: {cell}", width - 2)
            lines += [
                f"{GAP}{first}",
                *(f"{GAP}{GAP}{part}" for line in rest for part in _wrapped(line, width - 4)),
            ]
    return lines


def _wrapped(text: str, width: int) -> list[str]:
    """Break text between words only."""
    return textwrap.wrap(text, max(width, 1), break_long_words=False, break_on_hyphens=False) or [""]
