"""``fleet run``: the fleet of a fleet file, in the foreground, with a supervisor as its parent.

Nothing that can fail is imported here: the supervisor outlives the edge.
"""

from __future__ import annotations

import os
import resource
import sys

import click

from fleet.bus.settings import runtime_dir
from fleet.cli.options import log_options
from fleet.cli.output import Output, with_output
from fleet.clock import SystemClock
from fleet.supervisor.notices import print_in_thread
from fleet.supervisor.sockets import socket_of
from fleet.supervisor.supervisor import Supervisor


@click.command()
@click.argument("file", default="fleet.yaml", type=click.Path())
@log_options
@with_output
def run(out: Output, file: str, *, verbose: int, log_file: str | None, log_format: str) -> int:
    """Run the fleet of FILE (fleet.yaml when left out) until Ctrl-C.

    Robots that cannot run are told and left out; the others run, and the exit code is then 7. With --json
    each change of a robot is one line of JSON. An edge that dies is started again at once, and its robots
    are halted meanwhile.
    """
    options = ["--json"] * out.as_json + ["--no-color"] * (not out.color) + ["-v"] * verbose
    options += ["--log-format", log_format, *(["--log-file", log_file] if log_file else [])]
    # -P: what lies in the user's folder is not to be imported in place of our own modules.
    command = [sys.executable, "-P", "-m", "fleet", "run-edge", *options, "--", file]
    path = socket_of(runtime_dir(), os.getpid())
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)  # each robot's link is one
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, hard), hard))
    farewell = [sys.executable, "-P", "-m", "fleet.bridge.disconnect_program"]
    return Supervisor(command, path=path, told=print_in_thread, clock=SystemClock(), farewell=farewell).run()
