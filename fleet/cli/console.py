"""``fleet console``: the fleet in a browser."""

from __future__ import annotations

import asyncio
import contextlib
import os

import click
import msgspec

from fleet.bus.settings import client_dirs, is_running, runtime_dir
from fleet.cli.console_people import people
from fleet.cli.options import reach_option
from fleet.cli.output import ExitCode, Output, with_output
from fleet.client.local_user import local_user
from fleet.clock import SystemClock
from fleet.console.child import EXTRA, ConsoleChild, is_installed
from fleet.console.login_links import LinkRequest, all_links
from fleet.console.task import PORT, ConsoleTask
from fleet.errors import NotRunning
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.model.permission import Permission
from fleet.runtime.event_loop import run
from fleet.spool.state_folder import state_folder


@click.group(invoke_without_command=True)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=None,
    help=f"On 127.0.0.1; left out that of the file or {PORT}, or any that is free.",
)
@click.option("--link", "link_only", is_flag=True, help="Print a new link to each console that runs.")
@click.option(
    "--foxglove",
    is_flag=True,
    help="Print an address for Foxglove, of each console that runs: a live view that changes nothing.",
)
@click.option(
    "--permission",
    type=click.Choice([each.word for each in Permission]),
    default=Permission.ADMIN.word,
    show_default=True,
    help="Permission of the link's user; everybody may stop robots.",
)
@click.option(
    "--recordings",
    type=click.Path(exists=True, file_okay=False, resolve_path=True),
    help="Also show this recording; those of the edges' own recorders are shown anyway.",
)
@reach_option
@with_output
def console(
    out: Output,
    *,
    port: int | None,
    link_only: bool,
    foxglove: bool,
    permission: str,
    recordings: str | None,
    file: str | None,
) -> ExitCode:
    """Show the fleet in a browser: a map, what each robot does, and a stop for all of them.

    Serves a page on this computer only, until Ctrl-C, and prints a link to it. A link works once, within ten
    minutes; --link prints another. The page shows every edge that runs on this computer, now or later, or
    those that the file reaches. With console.listen in the file, people log in from other computers too,
    unless the file's edge runs here: then they log in at the console of that edge.
    """
    if click.get_current_context().invoked_subcommand is not None:
        return ExitCode.OK
    requested = LinkRequest(local_user(), Permission[permission.upper()])
    if link_only or foxglove:
        return _links(out, msgspec.structs.replace(requested, to="foxglove") if foxglove else requested)
    if not is_installed():
        raise click.ClickException(EXTRA)
    task = _task(port, recordings) if file is None else _task_of(file, port, recordings)
    if task.login is not None:
        out.note(f"people log in at port {task.login.port} of {task.login.host} (console.listen)")
    return run(_serve(out, task, requested))


console.add_command(people)


def _task(port: int | None, recordings: str | None) -> ConsoleTask:
    """Return the task of a console for all edges on this computer."""
    return ConsoleTask(
        str(os.getpid()),
        PORT if port is None else port,
        any_port=port is None,
        recordings=(recordings,) if recordings else (),
        beside=str(state_folder("any").parent),
    )


def _task_of(file: str, port: int | None, recordings: str | None) -> ConsoleTask:
    """Return the task of a console for the edges that a fleet file reaches, with its login.

    The login of an edge that runs here is served by the console beside it, which has the port.
    """
    from fleet.cli.console_login import basemap_of, login_task  # noqa: PLC0415 - pydantic is not needed without a file
    from fleet.cli.record_task import folder_of  # noqa: PLC0415
    from fleet.config.load import sections_of  # noqa: PLC0415
    from fleet.host.process.component_settings import bus_settings  # noqa: PLC0415

    sections = sections_of(file)
    task = _task(port, recordings)
    runs_here = any(is_running(sections.edge.id, each) for each in client_dirs())
    wanted = sections.console.port if sections.console is not None else PORT
    return msgspec.structs.replace(
        task,
        port=wanted if port is None else port,
        edges=(bus_settings(sections),),
        only=True,
        recordings=(*task.recordings, str(folder_of(sections))),
        beside="",
        basemap=basemap_of(sections),
        login=None if runs_here else login_task(sections),
    )


def _links(out: Output, requested: LinkRequest) -> ExitCode:
    """Print a new link to each running console."""
    links = all_links(runtime_dir(), requested)
    if not links:
        raise NotRunning("no console is running here; start one with: fleet console")
    out.data({"links": links})
    for name, link in links.items():
        out.say(link if len(links) == 1 else f"{name}: {link}")
    return ExitCode.OK


async def _serve(out: Output, task: ConsoleTask, requested: LinkRequest) -> ExitCode:
    """Serve until a signal, or until the console ends by itself."""
    ended = asyncio.Event()
    end_by_signal(ended.set)

    def served(link: str) -> None:
        out.data({"link": link})
        out.say(link)
        out.note("good once, for ten minutes; another: fleet console --link; Ctrl-C ends the console")

    child = ConsoleChild(task, runtime_dir(), SystemClock(), requested=requested, served=served)
    running = asyncio.create_task(child.run(again=False), name="console")
    ending = asyncio.create_task(ended.wait(), name="ended")
    await asyncio.wait({running, ending}, return_when=asyncio.FIRST_COMPLETED)
    code = ExitCode.OK if ended.is_set() else ExitCode.RUNTIME_ERROR
    for task_ in (running, ending):
        task_.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task_
    return code
