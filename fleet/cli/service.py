"""``fleet service``: an edge as a service of systemd."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import click

from fleet.cli.output import ExitCode, Output, with_output
from fleet.config.edge_id import EDGE_ID
from fleet.config.load import load, sections_of
from fleet.errors import ConfigError, NotRunning
from fleet.service.install import (
    Run,
    ServiceError,
    files_of,
    install,
    is_root,
    run_program,
    status_of,
    uninstall,
)
from fleet.service.unit import ServiceSpec, spec_of, unit_name

_FILE = click.argument("file", default="fleet.yaml", type=click.Path(path_type=Path))


def _choose(_context: click.Context, _option: click.Parameter, edge: str | None) -> None:
    """Select the edge when the file of a pair is read."""
    if edge is not None:
        os.environ[EDGE_ID] = edge


_EDGE_ID = click.option(
    "--edge-id",
    metavar="NAME",
    expose_value=False,
    is_eager=True,
    callback=_choose,
    help="Which edge of the file's pair this computer is.",
)
_ROOT = click.option(
    "--root",
    type=click.Path(file_okay=False, path_type=Path),
    help="Below this folder instead of the running system, as for an image; no program is run.",
)


@click.group()
def service() -> None:
    """Run the edge of a fleet file as a service of systemd.

    The service has its own user and group (fleet), sees no home folders, opens only the devices that the
    fleet file names, and is restarted when it ends or freezes. Members of the group fleet command its robots.
    """


@service.command("install")
@_FILE
@_EDGE_ID
@_ROOT
@click.option("--print", "shown", is_flag=True, help="Print the files and write none.")
@click.option("--no-start", is_flag=True, help="Enable the service, but do not start it yet.")
@with_output
def install_(out: Output, file: Path, *, root: Path | None, shown: bool, no_start: bool) -> None:
    """Install the edge of FILE as a service, and start it. Needs root; after a change, run it again.

    A running service continues with its old unit until  systemctl restart fleet-EDGE: an install does not
    stop its robots.
    """
    spec = _spec(file)
    if shown:
        texts = {str(Path("/", path)): text for path, text in files_of(spec).items()}
        out.data({"edge": spec.edge, "files": texts})
        for name, text in texts.items():
            out.lines([f"# {name}", *text.splitlines(), ""])
        return
    written = install(spec, root or Path("/"), _runner(root), start=not no_start)
    out.data({"edge": spec.edge, "unit": spec.unit, "files": [str(path) for path in written]})
    for path in written:
        out.say(f"wrote {path}")
    out.note(f"next: fleet doctor {file}")


@service.command()
@_FILE
@_EDGE_ID
@with_output
def status(out: Output, file: Path) -> ExitCode:
    """Show whether the service of the edge of FILE runs, since when, and how often it was restarted.

    Exit code 4 if it does not run. The robots: fleet ps.
    """
    edge = _edge(file)
    found = status_of(edge, run_program)
    out.data({"edge": edge, "unit": unit_name(edge), **found})
    if found.get("LoadState") != "loaded":
        raise NotRunning(f"edge {edge} is not installed as a service; fleet service install {file}")
    since = found.get("ActiveEnterTimestamp") or "never"
    state = f"{found.get('ActiveState', 'unknown')} ({found.get('SubState', 'unknown')})"
    out.say(f"{unit_name(edge)}: {state}, {found.get('UnitFileState', '')}, last started: {since}")
    out.say(f"process {found.get('MainPID', '-')}, restarts {found.get('NRestarts', '-')}")
    if found.get("StatusText"):
        out.say(found["StatusText"])
    return ExitCode.OK if found.get("ActiveState") == "active" else ExitCode.NOT_RUNNING


@service.command()
@_FILE
@_EDGE_ID
@click.option("-f", "--follow", is_flag=True, help="Follow new lines until Ctrl-C.")
@click.option("-n", "--last", type=click.IntRange(min=0), default=100, show_default=True, help="Lines.")
@click.option("--robot", help="Only lines about this robot.")
@with_output
def logs(out: Output, file: Path, *, follow: bool, last: int, robot: str | None) -> None:
    """Show the log of the service of the edge of FILE, from the journal of systemd.

    It starts before the log of the edge, and includes the messages of systemd. With --json journald's own
    form.
    """
    program = shutil.which("journalctl")
    if program is None:
        raise ServiceError("this computer has no journalctl: a service needs systemd")
    command = [program, f"--unit={unit_name(_edge(file))}", f"--lines={last}", "--no-pager"]
    command += ["--follow"] * follow + ["--output=json"] * out.as_json
    command += [f"FLEET_ROBOT={robot}"] if robot else []
    sys.stdout.flush()
    os.execv(program, command)  # noqa: S606 - takes over our output and signals


@service.command("uninstall")
@_FILE
@_EDGE_ID
@_ROOT
@with_output
def uninstall_(out: Output, file: Path, *, root: Path | None) -> None:
    """Stop the service of the edge of FILE and remove it. Fleet file, state and user stay.

    Its robots are brought to a standstill first, as by Ctrl-C.
    """
    removed = uninstall(_edge(file), root or Path("/"), _runner(root))
    out.data({"removed": [str(path) for path in removed]})
    for path in removed:
        out.say(f"removed {path}")


def _runner(root: Path | None) -> Run | None:
    """Return the function that runs programs, None below another root; raises ServiceError if not root."""
    if root is not None:
        return None
    if not is_root():
        raise ServiceError("a service is installed by root: sudo fleet service install")
    return run_program


def _spec(file: Path) -> ServiceSpec:
    """Return the description of the service of a fleet file; raises ConfigError."""
    loaded = load(file)
    if loaded.config.pair is not None and not os.environ.get(EDGE_ID):
        which = " or ".join(loaded.config.pair)
        raise ConfigError(f"{file} is for a pair of edges: --edge-id {which} says which one this is")
    absolute = Path(os.path.abspath(file))  # noqa: PTH100 - keeps links such as current/fleet.yaml
    return spec_of(loaded, absolute, Path(sys.executable))


def _edge(file: Path) -> str:
    """Return the id of the edge of a fleet file; no adapter is imported."""
    return sections_of(file).edge.id
