"""Writes docs/reference/cli.md from the commands themselves; run it after changing one.

python docs/reference/make_cli_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import inspect
import pathlib
import re
from collections.abc import Iterator

import click

from fleet.cli import output
from fleet.cli.main import COMMANDS, fleet
from fleet.cli.output import ExitCode

OF_ADAPTERS = {"can": "Look at a quadruped's CAN buses and drives, move one joint."}
"""Commands that the adapters of this project bring (entry points ``fleet.commands``)."""
TARGET = pathlib.Path(__file__).with_name("cli.md")
INTRODUCTION = """\
# The command line

Made from the commands by `docs/reference/make_cli_reference.py`; do not edit.

Results go to stdout, everything else to stderr. `--json` prints one JSON document for programs;
where a command fails it is `{"error": "...", "code": 4}`, with the exit code, and `problems` of a fleet file.
Colours are off with `--no-color`, with `NO_COLOR=1`, and when the output is no terminal.
Tables fit the terminal; on a narrow one each row becomes a block. `fleet ps` omits whole columns and
rows that do not fit, and says which.
"""


def exit_codes() -> Iterator[str]:
    """Yield the table of exit codes; the remarks are those of the enum's own source."""
    source = inspect.getsource(output.ExitCode)
    yield from ("", "## Exit codes", "", "| code | name | |", "|---|---|---|")
    for code in ExitCode:
        remark = re.search(rf"\b{code.name} = \d+(?:  # (.*))?", source)
        words = code.name.lower().replace("_", " ")
        yield f"| {code.value} | {words} | {(remark and remark[1]) or ''} |"


def command_section(name: str, command: click.Command, parent: click.Context) -> Iterator[str]:
    """Yield the section of one command: usage, words, options."""
    context = click.Context(command, info_name=command.name, parent=parent, terminal_width=100)
    yield from (
        "",
        f"## fleet {name}",
        "",
        "```",
        command.get_usage(context).removeprefix("Usage: "),
        "```",
        "",
    )
    yield from inspect.cleandoc(command.help or "").splitlines()
    records = [
        record
        for each in command.get_params(context)
        if (record := each.get_help_record(context)) and record[1]
    ]
    if records:
        yield from ("", "| option | |", "|---|---|")
        for option, words in records:
            yield f"| `{option}` | {words} |"
    for each, inner in getattr(command, "commands", {}).items():
        yield from command_section(f"{name} {each}", inner, context)


def render() -> str:
    """Return the whole reference."""
    lines = [INTRODUCTION.rstrip(), "", "| command | |", "|---|---|"]
    lines += [f"| [`fleet {name}`](#fleet-{name}) | {COMMANDS[name].summary} |" for name in COMMANDS]
    lines += [f"| [`fleet {name}`](#fleet-{name}) | {words} |" for name, words in OF_ADAPTERS.items()]
    lines += exit_codes()
    context = click.Context(fleet, info_name="fleet", **fleet.context_settings)
    for name in (*COMMANDS, *OF_ADAPTERS):
        command = fleet.get_command(context, name)
        if command is not None:
            lines += command_section(name, command, context)
    return "\n".join(line.rstrip() for line in lines) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
