"""The group of commands. Each is imported when it is used, so that help and errors are fast."""

from __future__ import annotations

import contextlib
import importlib
import json
import logging
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import click

from fleet.cli.adapter_commands import adapter_commands, load_command, package_of
from fleet.cli.interrupt import end_on_interrupt, restore_interrupt
from fleet.cli.output import ExitCode, exit_code_of, show_error
from fleet.config.text import nearest
from fleet.errors import FleetError
from fleet.version import __version__

log = logging.getLogger(__name__)


class Entry(NamedTuple):
    """A command: its ``place``, from which it is imported when it is used, and its line in the overview."""

    place: str
    summary: str


COMMANDS: Mapping[str, Entry] = {
    "init": Entry("fleet.cli.init:init", "Write an example fleet.yaml."),
    "check": Entry("fleet.cli.check:check", "Check a fleet file and report every error."),
    "run": Entry("fleet.cli.run:run", "Run the fleet of a fleet file."),
    "diff": Entry(
        "fleet.cli.changes:diff", "Show what a changed fleet file would change in the running edge."
    ),
    "apply": Entry("fleet.cli.changes:apply", "Apply a changed fleet file to the running edge."),
    "bundle": Entry("fleet.cli.bundle:bundle", "Make, show and install signed bundles of a configuration."),
    "rollout": Entry(
        "fleet.cli.rollout:rollout", "Run the agent of an edge, and control roll-outs to many edges."
    ),
    "demo": Entry("fleet.cli.demo:demo", "Run simulated robots; nothing else is needed."),
    "ps": Entry("fleet.cli.ps:ps", "Show the running robots and their health."),
    "top": Entry("fleet.cli.top:top", "Show a site or a whole fleet, live: troubles by cause."),
    "console": Entry("fleet.cli.console:console", "Show the fleet in a browser."),
    "record": Entry(
        "fleet.cli.record:record", "Record reports and requests of robots in files for Foxglove."
    ),
    "replay": Entry(
        "fleet.cli.replay:replay", "Play a recording again, or feed its raw frames to today's adapters."
    ),
    "describe": Entry(
        "fleet.cli.describe:describe", "Show the commands of a robot, and whether it would accept them now."
    ),
    "send": Entry("fleet.cli.send:send", "Send a command to a robot and wait for its answer."),
    "goto": Entry("fleet.cli.goto:goto", "Send a robot to a place."),
    "stop": Entry("fleet.cli.stop:stop", "Stop robots at once."),
    "release": Entry(
        "fleet.cli.release:release", "Release stopped robots, and show who stopped them, when and why."
    ),
    "history": Entry("fleet.cli.history:history", "Show the commands to robots, their senders and outcomes."),
    "ready": Entry("fleet.cli.ready:ready", "Show whether an aircraft would take off now, and why not."),
    "mission": Entry(
        "fleet.cli.mission:mission", "Start, follow and control missions of one or several robots."
    ),
    "schedule": Entry("fleet.cli.schedule:schedule", "Show, enable and disable the schedules of missions."),
    "take": Entry("fleet.cli.take:take", "Take a robot out of the run of a mission."),
    "params": Entry("fleet.cli.params:params", "Read and write a robot's own parameters."),
    "logs": Entry("fleet.cli.logs:logs", "Show the log of an edge and its workers."),
    "flight-logs": Entry(
        "fleet.cli.flight_logs:flight_logs", "List and fetch the logs that a robot keeps on board."
    ),
    "video": Entry("fleet.cli.video:video", "Send a camera's pictures as video on request of the cloud."),
    "spool": Entry(
        "fleet.cli.spool:spool", "Show or delete the messages that are queued for the cloud on disk."
    ),
    "failover": Entry("fleet.cli.failover:failover", "Hand the robots of a pair over to its other edge."),
    "service": Entry(
        "fleet.cli.service:service", "Run the edge as a service of systemd: install, status, logs, uninstall."
    ),
    "doctor": Entry("fleet.cli.doctor:doctor", "Check everything around an edge, and suggest remedies."),
    "backup": Entry("fleet.cli.backup:backup", "Pack state and configuration, to replace a dead computer."),
    "restore": Entry("fleet.cli.restore:restore", "Restore the backup of an edge on this computer."),
    "support": Entry(
        "fleet.cli.support:support", "Pack configuration, logs and history, without secrets, for support."
    ),
    "certs": Entry("fleet.cli.certs:certs", "Make and renew the certificates of a site's bus."),
    "calibrate": Entry("fleet.cli.calibrate:calibrate", "Measure a wheeled robot's wheels and turns."),
    "adapters": Entry(
        "fleet.cli.adapters:adapters",
        "Show the kinds of robots that can be used, make new ones, reload changed ones.",
    ),
    "schema": Entry("fleet.cli.schema:schema", "Print the JSON Schema of fleet.yaml for editors."),
    "completion": Entry(
        "fleet.cli.completion:completion", "Print the shell completion for robots and commands."
    ),
}
HIDDEN: Mapping[str, str] = {"run-edge": "fleet.cli.run_edge:run_edge"}
"""Commands for the project's own programs, not for users."""


class LazyGroup(click.Group):
    """A group whose commands are imported by name from ``COMMANDS``."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        """Return the names in the order of the table, then those of adapters."""
        return list(dict.fromkeys((*COMMANDS, *adapter_commands())))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import a command; None if there is none of this name."""
        found = COMMANDS[cmd_name].place if cmd_name in COMMANDS else HIDDEN.get(cmd_name)
        point = None if found else adapter_commands().get(cmd_name)
        if not found and point is None:
            return None
        interruptible = end_on_interrupt()
        try:
            if point is not None:
                return load_command(point)
            module, _, attribute = (found or "").partition(":")
            command: click.Command = getattr(importlib.import_module(module), attribute)
            return command
        finally:
            if interruptible:
                restore_interrupt()

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command of a line; for an unknown one, suggest the most similar."""
        known = COMMANDS.keys() | HIDDEN.keys()
        if args[0] not in known and not args[0].startswith("-") and args[0] not in adapter_commands():
            near = nearest(args[0], self.list_commands(ctx))
            ctx.fail(f"there is no command {args[0]!r}{f'; {near}' if near else ''}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, each.summary) for name, each in COMMANDS.items()])
        brought = [(name, each) for name, each in adapter_commands().items() if name not in COMMANDS]
        if brought:
            with formatter.section("Commands of adapters (fleet NAME --help)"):
                formatter.write_dl([(name, f"of {package_of(each)}") for name, each in brought])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="fleet", message="%(prog)s %(version)s")
def fleet() -> None:
    """One fleet.yaml, one command: drones, quadrupeds and wheeled robots as one fleet.

    Results go to stdout, everything else to stderr; with --json an error is {"error": ..., "code": ...} on
    stdout as well. Exit codes: 0 ok, 1 runtime error, 2 usage, 3 configuration invalid, 4 edge not running, 5
    command rejected or denied, 6 timeout, 7 some robots failed, 8 mission not completed, 9 outcome unknown,
    130 interrupted.
    """


def _write_error_json(arguments: Sequence[str], error: FleetError | str, code: int) -> None:
    """Write an error as one line of JSON to stdout, if --json was given."""
    if "--json" not in arguments:
        return
    problems = [str(problem) for problem in getattr(error, "problems", ())]
    document = {"error": str(error), "code": int(code)} | ({"problems": problems} if problems else {})
    sys.stdout.write(json.dumps(document) + "\n")
    sys.stdout.flush()


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code. Errors are one line each on stderr."""
    for name in ("stdout", "stderr"):  # closed by the parent process: a stop must be sent nevertheless
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - until the end
    try:
        result: object = fleet.main(args=list(arguments), prog_name="fleet", standalone_mode=False)
        sys.stdout.flush()
    except click.Abort:
        return ExitCode.INTERRUPTED
    except click.ClickException as error:
        error.show()
        _write_error_json(arguments, error.format_message(), error.exit_code)
        return error.exit_code
    except FleetError as error:
        show_error(error)
        _write_error_json(arguments, error, exit_code_of(error))
        return exit_code_of(error)
    except OSError as error:  # the reader of our output is gone (as with head), or its disk is full
        if not isinstance(error, BrokenPipeError):
            log.debug("the command failed", exc_info=True)
            sys.stderr.write(f"fleet: {error}\n")
            with contextlib.suppress(OSError):
                _write_error_json(arguments, str(error), ExitCode.RUNTIME_ERROR)
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.RUNTIME_ERROR
    return result if isinstance(result, int) else ExitCode.OK
