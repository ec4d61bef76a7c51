"""``fleet check``: every error in a fleet file, or one line that confirms it."""

from __future__ import annotations

from collections import Counter

import click
import msgspec

from fleet.cli.output import ExitCode, Output, counted, show_error, with_output
from fleet.clock import SystemClock
from fleet.config.difference import digest_of
from fleet.config.load import Loaded, load
from fleet.config.problems import InvalidConfig, Problem


@click.command()
@click.argument("file", default="fleet.yaml", type=click.Path())
@with_output
def check(out: Output, file: str) -> ExitCode:
    """Check a fleet file and report every error.

    Reads FILE (fleet.yaml when left out) and its included files, and imports the adapters that its robots
    name. Opens no link and no connection. Exit code 3 for an error; a warning does not change it.
    """
    try:
        loaded = load(file)
    except InvalidConfig as error:
        return _invalid(out, file, error)
    if problems := _of_login(loaded):
        return _invalid(out, file, InvalidConfig(problems))
    found = (*loaded.warnings, *_of_certificates(loaded))
    warnings = [msgspec.to_builtins(warning) for warning in found]
    moved = _moved_after(loaded)
    digest = digest_of(loaded) if loaded.config.pair else ""
    pair = {"pair": loaded.config.pair, "moved_after": moved, "pair_file": digest} if digest else {}
    out.data({"ok": True, "file": file, **_summary(loaded), **pair, "problems": [], "warnings": warnings})
    for warning in found:
        for line in f"warning: {warning.shown()}".splitlines():  # a note escapes line breaks
            out.note(line)
    if moved:
        rows = [(name, _in_words(seconds)) for name, seconds in moved.items()]
        out.table(("robot", "moved by the standby, after the last sign of the other edge"), rows)
    if digest:
        out.say(f"the other edge of the pair takes over only if its file has the same digest: {digest}")
    out.say(f"{file} is valid: {_sentence(loaded)}")
    return ExitCode.OK


def _invalid(out: Output, file: str, error: InvalidConfig) -> ExitCode:
    """Show the errors."""
    problems = [msgspec.to_builtins(problem) for problem in error.problems]
    out.data({"ok": False, "file": file, "problems": problems})
    if not out.as_json:
        show_error(error)
    return ExitCode.CONFIG_INVALID


def _of_login(loaded: Loaded) -> tuple[Problem, ...]:
    """Return why no login at the console is possible, if one is configured."""
    if loaded.config.console is None or loaded.config.console.listen is None:
        return ()
    from fleet.cli.console_login import login_problems  # noqa: PLC0415 - not needed without a login

    return login_problems(loaded)


def _of_certificates(loaded: Loaded) -> list[Problem]:
    """Return warnings about the expiry of certificates."""
    if not (loaded.config.bus.tls or (loaded.config.console and loaded.config.console.tls)):
        return []
    from fleet.host.edge.certificate_expiry import CertificateExpiry, files_of  # noqa: PLC0415 - not needed without certificates

    return [
        Problem(str(file), 1, 1, place, problem)
        for file, place in files_of(loaded.config).items()
        for problem in CertificateExpiry([file], SystemClock()).problems
    ]


def _moved_after(loaded: Loaded) -> dict[str, float | None]:
    """Return the seconds after which a standby moves each robot; None: only after an operator stops it."""
    if loaded.config.pair is None:
        return {}
    from fleet.standby.bound import MotionBound  # noqa: PLC0415 - not needed without a pair
    from fleet.standby.lease import LeaseTimes  # noqa: PLC0415

    bounds = {
        robot.name: MotionBound(robot.setpoint_lease, robot.failsafe_after) for robot, _ in loaded.robots
    }
    return {name: bound.after(LeaseTimes().length) for name, bound in bounds.items()}


def _in_words(seconds: float | None) -> str:
    """Return a bound as text."""
    return "after an operator has stopped it from there" if seconds is None else f"{seconds:g} s"


def _summary(loaded: Loaded) -> dict[str, object]:
    """Return a summary of the file, for programs."""
    cloud = loaded.config.cloud
    return {
        "edge": loaded.config.edge.id,
        "robots": [
            {"name": robot.name, "twin": robot.twin, "adapter": plugin.name, "simulated": robot.simulated}
            for robot, plugin in loaded.robots
        ],
        "groups": loaded.config.members,
        "cloud": f"{cloud.host}:{cloud.port}" if cloud else None,
    }


def _sentence(loaded: Loaded) -> str:
    """Return a summary of the file on one line."""
    kinds = Counter(plugin.name for _, plugin in loaded.robots)
    robots = ", ".join(f"{number} {name}" for name, number in sorted(kinds.items()))
    cloud = loaded.config.cloud
    return (
        f"edge {loaded.config.edge.id}, {counted(len(loaded.robots), 'robot')} ({robots}), "
        f"{counted(len(loaded.config.members), 'group')}, {f'cloud {cloud.host}' if cloud else 'no cloud'}"
    )
