"""``fleet run``: the fleet of a fleet file, in the foreground."""

from __future__ import annotations

from pathlib import Path

import click

from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.serve import serve
from fleet.config.load import load
from fleet.host.edge import Edge


@click.command()
@click.argument("file", default="fleet.yaml", type=click.Path())
@click.option("-v", "--verbose", count=True, help="Log more; twice for everything.")
@with_output
def run(out: Output, file: str, verbose: int) -> ExitCode:
    """Run the fleet of FILE (fleet.yaml when left out) until Ctrl-C.

    Robots that cannot run are told and left out; the others run, and the exit code is then 7. With --json
    each change of a robot is one line of JSON.
    """
    loaded = load(file, partial=True)
    for problem in loaded.problems:
        out.note(f"left out: {problem}")
    for warning in loaded.warnings:
        out.note(f"warning: {warning}")

    def started(_edge: Edge) -> None:
        out.note(f"edge {loaded.config.edge.id} runs; see it with: fleet ps")

    return serve(loaded, Path(file), out, verbose=verbose, started=started)
