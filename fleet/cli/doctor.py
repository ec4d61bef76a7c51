"""``fleet doctor``: checks of everything around an edge, with remedies."""

from __future__ import annotations

import os
from pathlib import Path

import click
import msgspec

from fleet.cli.output import ExitCode, Output, counted, with_output
from fleet.doctor.examination import CONFIG, examine
from fleet.doctor.finding import Finding, Rating


@click.command()
@click.argument("file", default="fleet.yaml", type=click.Path(path_type=Path))
@click.option(
    "--plugins", is_flag=True, help="Also check the robots, which imports adapters and drop-in files."
)
@with_output
def doctor(out: Output, file: Path, *, plugins: bool) -> ExitCode:
    """Check everything around the edge of FILE, and suggest remedies.

    Clock, disk, permissions, devices, CAN, ports, broker, certificates, state, versions and other edges. It
    changes nothing, opens no device and sends nothing to robots, so it can run beside the edge. With an
    installed service, permissions are checked for its user; some checks need sudo.

    Exit code 0 without errors (warnings do not count), 1 for an error, 3 for an invalid fleet file.
    """
    findings = examine(file, os.environ, plugins=plugins)
    code = code_of(findings)
    out.data({"ok": code is ExitCode.OK, "findings": msgspec.to_builtins(findings)})
    for each in findings:
        out.say(f"{each.verdict.value:<8} {each.check}: {each.found}")
        if each.cure:
            out.say(f"{'':<8}   {each.cure}")
    out.note(_summary(findings))
    return code


def code_of(findings: list[Finding]) -> ExitCode:
    """Return the exit code for some findings."""
    wrong = [each.check for each in findings if each.verdict is Rating.ERROR]
    if CONFIG in wrong:
        return ExitCode.CONFIG_INVALID
    return ExitCode.RUNTIME_ERROR if wrong else ExitCode.OK


def _summary(findings: list[Finding]) -> str:
    """Return the numbers of findings by verdict, on one line."""
    numbers = {verdict: sum(each.verdict is verdict for each in findings) for verdict in Rating}
    return (
        f"{counted(numbers[Rating.ERROR], 'error')}, {counted(numbers[Rating.WARNING], 'warning')}, "
        f"{numbers[Rating.UNKNOWN]} unknown, {numbers[Rating.OK]} ok"
    )
