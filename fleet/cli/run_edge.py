"""``fleet run-edge``: the edge itself, started by the supervisor of ``fleet run``."""

from __future__ import annotations

import os

import click

from fleet.cli.options import log_options
from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.serve import logs_to, serve
from fleet.config.edge_id import EDGE_ID
from fleet.config.load import load
from fleet.errors import ConfigError
from fleet.host.edge.edge import Edge
from fleet.host.logs.line_format import Format
from fleet.supervisor.client import connect_supervisor


@click.command(hidden=True)
@click.argument("file", type=click.Path())
@click.option("--watch", is_flag=True)
@log_options
@with_output
def run_edge(
    out: Output, file: str, *, watch: bool, verbose: int, log_file: str | None, log_format: Format
) -> ExitCode:
    """Run the fleet of FILE until a signal ends it."""
    loaded = load(file, partial=True)
    if loaded.config.pair is not None and not os.environ.get(EDGE_ID):
        which = " or ".join(loaded.config.pair)
        raise ConfigError(
            f"{file} is for a pair of edges: fleet run --edge-id {which} says which one this is"
        )
    for problem in loaded.problems:
        out.note(f"left out: {problem}")
    for warning in loaded.warnings:
        out.note(f"warning: {warning}")

    def started(edge: Edge) -> None:
        if watch:
            edge.watch_drop_ins()
        out.note(f"edge {loaded.config.edge.id} runs; see it with: fleet ps")

    logs = logs_to(verbose, log_file, log_format)
    return serve(loaded, out, logs=logs, started=started, supervised=connect_supervisor())
