"""``fleet service``: an edge as a service of systemd."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path

import click

from fleet.cli.output import ExitCode, Output, with_output
from fleet.config.edge_id import EDGE_ID
from fleet.config.load import load, sections_of
from fleet.errors import ConfigError, NotRunning
from fleet.service.agent_unit import AgentSpec, agent_spec_of, agent_unit_name
from fleet.service.install import (
    RunProgram,
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
    The agent of its roll-outs can be a second service of the same user.
    """


@service.command("install")
@_FILE
@_EDGE_ID
@_ROOT
@click.option("--print", "shown", is_flag=True, help="Print the files and write none.")
@click.option("--no-start", is_flag=True, help="Enable the service, but do not start it yet.")
@click.option(
    "--agent",
    "with_agent",
    is_flag=True,
    help="Also install the agent of its roll-outs; FILE must be FOLDER/current/fleet.yaml.",
)
@with_output
def install_(
    out: Output, file: Path, *, root: Path | None, shown: bool, no_start: bool, with_agent: bool
) -> None:
    """Install the edge of FILE as a service, and start it. Needs root; after a change, run it again.

    A running service continues with its old unit until  systemctl restart fleet-EDGE: an install does not
    stop its robots. With --agent, the folder of the bundles is given to the user fleet.
    """
    spec = _spec(file)
    agent = _agent_spec(spec) if with_agent else None
    if shown:
        texts = {str(Path("/", path)): text for path, text in files_of(spec, agent).items()}
        out.data({"edge": spec.edge, "files": texts})
        for name, text in texts.items():
            out.lines([f"# {name}", *text.splitlines(), ""])
        return
    written = install(spec, root or Path("/"), _runner(root), start=not no_start, agent=agent)
    installed = {"edge": spec.edge, "unit": spec.unit, "files": [str(path) for path in written]}
    out.data({**installed, "agent": agent.unit if agent else None})
    for path in written:
        out.say(f"wrote {path}")
    out.note(f"next: fleet doctor {file}")


@service.command()
@_FILE
@_EDGE_ID
@with_output
def status(out: Output, file: Path) -> ExitCode:
    """Show whether the service of the edge of FILE runs, since when, and how often it was restarted.

    The agent of its roll-outs is shown too if it is installed. Exit code 4 if one of them does not run. For
    the robots: fleet ps.
    """
    edge = _edge(file)
    units = (unit_name(edge), agent_unit_name(edge))
    found, agent = (status_of(unit, run_program) for unit in units)
    has_agent = agent.get("LoadState") == "loaded"
    out.data({"edge": edge, "unit": units[0], **found, "agent": agent if has_agent else None})
    if found.get("LoadState") != "loaded":
        raise NotRunning(f"edge {edge} is not installed as a service; fleet service install {file}")
    shown = [(units[0], found), *([(units[1], agent)] if has_agent else [])]
    for unit, values in shown:
        _write_status(out, unit, values)
    runs = all(values.get("ActiveState") == "active" for _, values in shown)
    return ExitCode.OK if runs else ExitCode.NOT_RUNNING


def _write_status(out: Output, unit: str, values: Mapping[str, str]) -> None:
    """Show systemd's properties of a unit."""
    since = values.get("ActiveEnterTimestamp") or "never"
    state = f"{values.get('ActiveState', 'unknown')} ({values.get('SubState', 'unknown')})"
    out.say(f"{unit}: {state}, {values.get('UnitFileState', '')}, last started: {since}")
    out.say(f"process {values.get('MainPID', '-')}, restarts {values.get('NRestarts', '-')}")
    if values.get("StatusText"):
        out.say(values["StatusText"])


@service.command()
@_FILE
@_EDGE_ID
@click.option("-f", "--follow", is_flag=True, help="Follow new lines until Ctrl-C.")
@click.option("-n", "--last", type=click.IntRange(min=0), default=100, show_default=True, help="Lines.")
@click.option("--robot", help="Only lines about this robot.")
@click.option("--agent", "of_agent", is_flag=True, help="Show the log of the agent of its roll-outs instead.")
@with_output
def logs(out: Output, file: Path, *, follow: bool, last: int, robot: str | None, of_agent: bool) -> None:
    """Show the log of the service of the edge of FILE, from the journal of systemd.

    It starts before the log of the edge, and includes the messages of systemd. With --json journald's own
    form.
    """
    program = shutil.which("journalctl")
    if program is None:
        raise ServiceError("this computer has no journalctl: a service needs systemd")
    unit = agent_unit_name(_edge(file)) if of_agent else unit_name(_edge(file))
    command = [program, f"--unit={unit}", f"--lines={last}", "--no-pager"]
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
    """Stop and remove the service of the edge of FILE and its agent.

    Fleet file, bundles, state and user stay. Its robots are brought to a standstill first, as by Ctrl-C.
    """
    removed = uninstall(_edge(file), root or Path("/"), _runner(root))
    out.data({"removed": [str(path) for path in removed]})
    for path in removed:
        out.say(f"removed {path}")


def _runner(root: Path | None) -> RunProgram | None:
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


def _agent_spec(spec: ServiceSpec) -> AgentSpec:
    """Return the input of the unit of the agent; raises ConfigError, InvalidConfig."""
    from fleet.rollout.settings import FILE, read_settings  # noqa: PLC0415 - only needed with an agent

    agent = agent_spec_of(spec.edge, spec.file, spec.python)
    settings = read_settings(agent.folder / FILE)
    if settings.edge != spec.edge:
        raise ConfigError(f"{agent.folder / FILE} is for edge {settings.edge}, not {spec.edge}")
    return agent


def _edge(file: Path) -> str:
    """Return the id of the edge of a fleet file; no adapter is imported."""
    return sections_of(file).edge.id
