"""``fleet run``: the fleet of a fleet file, in the foreground, with a supervisor as its parent.

This module imports nothing that can fail: the supervisor outlives the edge.
"""

from __future__ import annotations

import os
import resource
import sys

import click

from fleet.bus.settings import fallback_dirs, runtime_dir
from fleet.cli.options import log_options
from fleet.cli.output import Output, with_output
from fleet.clock import SystemClock
from fleet.config.edge_id import EDGE_ID
from fleet.supervisor.notices import print_in_thread
from fleet.supervisor.service_manager import ServiceManager
from fleet.supervisor.sockets import socket_of
from fleet.supervisor.supervisor import Supervisor


@click.command()
@click.argument("file", default="fleet.yaml", type=click.Path())
@click.option("--worker", metavar="NAME", help="Run only this worker, for an edge on another computer.")
@click.option("--watch", is_flag=True, help="Take drop-in files into use when they are saved.")
@click.option("--edge-id", metavar="NAME", help="Which edge of the file's pair this computer is.")
@log_options
@with_output
def run(
    out: Output,
    file: str,
    *,
    worker: str | None,
    watch: bool,
    edge_id: str | None,
    verbose: int,
    log_file: str | None,
    log_format: str,
) -> int:
    """Run the fleet of FILE (fleet.yaml when left out) until Ctrl-C.

    Robots that cannot run are reported and left out; the others run, and the exit code is then 7. With --json
    each change of a robot is one line of JSON. An edge that dies is restarted at once, and its robots are
    halted meanwhile.

    --worker runs a worker that the edge lists under remote_workers; the bus.connect of its FILE is that edge.

    --edge-id is for the file of a pair: the two edges run with the same FILE, and one takes over when the
    other's computer dies.

    --watch is for authors of drop-in adapters: a saved file is checked, and its worker is restarted with it
    as soon as its robots rest; simulated robots do not wait.
    """
    if edge_id is not None:
        os.environ[EDGE_ID] = edge_id
    if worker is not None:
        return _supervised(["fleet.host.workers.worker_process", "--name", worker, "--config", file])
    options = ["--json"] * out.as_json + ["--no-color"] * (not out.color) + ["-v"] * verbose
    options += ["--watch"] * watch
    options += ["--log-format", log_format, *(["--log-file", log_file] if log_file else [])]
    return _supervised(["fleet", "run-edge", *options, "--", file], notice="fleet.bridge.disconnect_program")


def _supervised(module: list[str], *, notice: str = "") -> int:
    """Run a module of ours with its arguments below a supervisor; return its exit code.

    ``notice``: the module that reports the death of the edge to the cloud.
    """
    # -P: a file in the user's folder must not be imported in place of our own modules.
    python = [sys.executable, "-P", "-m"]
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)  # each robot's link needs a descriptor
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, hard), hard))
    return Supervisor(
        [*python, *module],
        paths=[socket_of(folder, os.getpid()) for folder in (runtime_dir(), *fallback_dirs())],
        report=print_in_thread,
        clock=SystemClock(),
        notice_command=[*python, notice] if notice else (),
        manager=ServiceManager.of_this_process(),
    ).run()
