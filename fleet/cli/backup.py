"""``fleet backup``: state and configuration of an edge in one file."""

from __future__ import annotations

import os
import time
from pathlib import Path

import click

from fleet.backup.archive import write_archive
from fleet.backup.making import pack
from fleet.cli.output import Output, counted, with_output
from fleet.config.load import sections_of
from fleet.doctor.examination import state_of

_SECONDS = "%Y%m%d-%H%M%S"


@click.command()
@click.argument("file", default="fleet.yaml", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), help="The file to write.")
@with_output
def backup(out: Output, file: Path, *, output: Path | None) -> None:
    """Pack state and configuration of the edge of FILE, to replace a dead computer.

    The edge may run. The backup has emergency stops, started commands, history, messages for the cloud, runs
    and schedules; fleet.yaml with its included and named files beside it; and the names of secrets, not their
    values. Logs and recordings are not in it. The state of a service needs sudo.
    """
    config = sections_of(file)
    state = state_of(config, os.environ)
    now = time.time()
    packed = pack(file, config, state, os.environ, now)
    path = output or Path(f"fleet-{config.edge.id}-{time.strftime(_SECONDS)}.backup")
    write_archive(path, packed.manifest, packed.contents)
    manifest = packed.manifest
    out.data(
        {
            "file": str(path),
            "edge": manifest.edge,
            "files": sorted(manifest.files),
            "secrets": manifest.secrets,
            "keys": manifest.keys,
            "masked": manifest.masked,
            "left_out": packed.left_out,
        }
    )
    out.say(f"{path}: {counted(len(manifest.files), 'file')} of edge {manifest.edge}")
    if not any(name.startswith("state/") for name in manifest.files):
        out.note(f"no state was found in {state}: the edge has not run yet, or as another user (sudo)")
    for left_out in packed.left_out:
        out.note(f"left out: {left_out}")
    if kept := (*manifest.secrets, *manifest.keys, *manifest.masked):
        out.note(f"keep these yourself, their values are not in it: {', '.join(kept)}")
