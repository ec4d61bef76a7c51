"""``fleet record``: record reports and requests to files for Foxglove."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path

import click
import msgspec

from fleet.bus.settings import runtime_dir
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, counted, with_output
from fleet.cli.times import length as length_option
from fleet.cli.times import since as time_of
from fleet.cli.times import since_option, when
from fleet.client.edges import settings_of
from fleet.clock import SystemClock
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.record.child import EXTRA, is_installed
from fleet.record.priority import lower_priority
from fleet.record.task import FOLDER, MIB, RecordTask
from fleet.runtime.event_loop import run


def _until(context: click.Context, option: click.Parameter, text: str | None) -> float:
    """Return the Unix seconds of a time; infinite without one."""
    return math.inf if text is None else time_of(context, option, text)


folder_option = click.option(
    "--from",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help=f"The folder of the recording. Left out: that of the fleet file, or {FOLDER}.",
)
of_file_option = click.option("-f", "--file", type=click.Path(), help="The fleet file with record: in it.")


@click.group(invoke_without_command=True)
@click.option(
    "--into",
    type=click.Path(file_okay=False, path_type=Path),
    default=FOLDER,
    show_default=True,
    help="The folder, for this recorder only.",
)
@click.option(
    "--for", "length", callback=length_option, help="How long: 30s, 10min, 1h. Left out: until Ctrl-C."
)
@reach_option
@with_output
@click.pass_context
def record(
    context: click.Context, out: Output, *, into: Path, length: float, file: str | None
) -> ExitCode | None:
    """Record reports and requests of robots in MCAP files, which Foxglove opens.

    Records every edge that runs on this computer, now or later, or the one of the file. The oldest files are
    deleted after 24 hours or beyond 2 GiB.
    """
    if context.invoked_subcommand is not None:
        return None
    if not is_installed():
        raise click.ClickException(EXTRA)
    edges = (settings_of(file),) if file else ()
    return run(_record(out, RecordTask(str(into), edges=edges, only=bool(edges)), length))


async def _record(out: Output, task: RecordTask, length: float) -> ExitCode:
    """Record until a signal or the end of the time."""
    from fleet.record.recording import record as recorded  # noqa: PLC0415 - its packages are an extra

    lower_priority()
    ended = asyncio.Event()
    end_by_signal(ended.set)
    if math.isfinite(length):
        asyncio.get_running_loop().call_later(length, ended.set)
    problems: list[str] = []

    def on_problem(problem: str) -> None:
        problems[:] = [problem] if problem else []
        out.note(problem or f"recording into {task.folder}; Ctrl-C ends it")

    count = await recorded(task, runtime_dir(), ended, SystemClock(), on_problem=on_problem)
    out.data({"folder": task.folder, "messages": count, "problem": "".join(problems)})
    out.say(f"{task.folder}: {counted(count, 'message')}")
    return ExitCode.RUNTIME_ERROR if problems else ExitCode.OK


@record.command("ls")
@folder_option
@of_file_option
@with_output
def list_files(out: Output, *, folder: Path | None, file: str | None) -> None:
    """Show the files of a recording; one in progress, or cut off, has no count yet."""
    from fleet.record.export import recorded_in  # noqa: PLC0415 - its packages are an extra

    found = recorded_in(_folder(folder, file))
    out.data(msgspec.to_builtins(found))
    out.table(
        ("from", "to", "MiB", "messages", "file"),
        [
            (
                when(each.begins),
                when(each.ends),
                f"{each.size / MIB:.1f}",
                "-" if each.messages is None else str(each.messages),
                each.path,
            )
            for each in found
        ],
    )


@record.command()
@click.argument("into", type=click.Path(dir_okay=False, path_type=Path))
@since_option
@click.option("--until", callback=_until, help="Up to when, as for --since.")
@folder_option
@of_file_option
@with_output
def export(
    out: Output, *, into: Path, since: float, until: float, folder: Path | None, file: str | None
) -> None:
    """Write a window of a recording into one new file."""
    from fleet.record.export import export as exported  # noqa: PLC0415 - its packages are an extra

    count = exported(_folder(folder, file), into, since=since, until=until)
    out.data({"file": str(into), "messages": count})
    out.say(f"{into}: {counted(count, 'message')}")


def _folder(given: Path | None, file: str | None) -> Path:
    """Return the selected folder; raises an error of the command line without the extra."""
    if not is_installed():
        raise click.ClickException(EXTRA)
    if given is not None or file is None:
        return given or Path(FOLDER)
    from fleet.cli.record_task import folder_of  # noqa: PLC0415 - pydantic is not needed without a file
    from fleet.config.load import sections_of  # noqa: PLC0415

    return folder_of(sections_of(file))
