"""``fleet restore``: restore the backup of an edge on this computer."""

from __future__ import annotations

import os
import time
from pathlib import Path

import click

from fleet.backup.archive import BackupError, Manifest, read_archive
from fleet.backup.restoring import restore as restore_backup
from fleet.bus.settings import is_running, runtime_dirs
from fleet.cli.output import Output, with_output
from fleet.service.unit import STATE
from fleet.spool.state_folder import state_folder

_FOLDER = click.Path(file_okay=False, path_type=Path)


@click.command()
@click.argument("archive", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--config", type=_FOLDER, help="Also write fleet.yaml and its files, to this folder.")
@click.option("--service", is_flag=True, help="To the state of a service (/var/lib/fleet); needs root.")
@click.option("--state", type=_FOLDER, help="To this folder, where edge.spool.path names it.")
@click.option("--replace", is_flag=True, help="Rename existing state; overwrite configuration.")
@with_output
def restore(
    out: Output, archive: Path, *, config: Path | None, service: bool, state: Path | None, replace: bool
) -> None:
    """Restore the backup ARCHIVE of an edge on this computer.

    Everything in it is checked before anything is written; the state is restored completely or not at all.
    Every robot is stopped afterwards: an emergency stop may have been set after the backup. fleet release
    shows and releases them.
    """
    manifest, contents = read_archive(archive)
    _refuse_running(manifest.edge)
    environ = {"XDG_STATE_HOME": str(STATE)} if service else os.environ
    folder = state or state_folder(manifest.edge, None, environ)
    done = restore_backup(manifest, contents, folder, config, replace=replace, now=time.time())
    out.data(
        {
            "edge": manifest.edge,
            "state": str(done.state),
            "before": str(done.before) if done.before else None,
            "config": [str(path) for path in done.config],
            "secrets": manifest.secrets,
            "keys": manifest.keys,
            "masked": manifest.masked,
        }
    )
    out.say(f"edge {manifest.edge}: state in {done.state}")
    for path in done.config:
        out.say(f"wrote {path}")
    for line in _next_steps(manifest, done.before):
        out.note(line)


def _refuse_running(edge: str) -> None:
    """Raise BackupError while the edge runs here, as any user."""
    if any(is_running(edge, place) for place in runtime_dirs()):
        raise BackupError(f"edge {edge} runs here: stop it first, systemctl stop fleet-{edge} or Ctrl-C")


def _next_steps(manifest: Manifest, before: Path | None) -> list[str]:
    """Return the remaining steps for the user."""
    steps = [f"the state before is in {before}"] if before else []
    if manifest.secrets:
        steps.append(f"write secrets.yaml (mode 600) with: {', '.join(manifest.secrets)}")
    if manifest.keys:
        steps.append(f"put back the private keys: {', '.join(manifest.keys)}")
    if manifest.masked:
        steps.append(f"values that stand as **** have to be filled in: {', '.join(manifest.masked)}")
    return [*steps, "then: fleet doctor, and fleet release once the robots are safe to move"]
