"""Run an edge in the foreground: signals, logs, the live view, and an orderly end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from fleet.bus.settings import runtime_dir
from fleet.cli.console_login import basemap_of, login_task
from fleet.cli.live import show
from fleet.cli.output import ExitCode, Output
from fleet.cli.record_task import folder_of, record_task
from fleet.clock import SystemClock
from fleet.config.load import Loaded
from fleet.console.child import ConsoleChild
from fleet.console.login_links import LinkRequest
from fleet.console.task import ConsoleTask
from fleet.host.edge.edge import Edge
from fleet.host.logs.folders import log_folder, show_log
from fleet.host.logs.line_format import Format
from fleet.host.logs.setup import LogSettings, start_logging
from fleet.host.process.component_settings import bus_settings
from fleet.host.runtime.termination_signals import end_by_signal
from fleet.record.child import RecorderChild
from fleet.robot_config import MAIN
from fleet.runtime.event_loop import run as run_loop
from fleet.runtime.realtime import NOT_PERMITTED, prefer_loop
from fleet.spool.state_folder import state_folder
from fleet.supervisor.client import SupervisorClient

TOGETHER = 1.0  # s within which signals count as one
STOPPING = "\nstopping: robots are brought to a standstill (Ctrl-C again to leave at once)\n"
LEVELS = (logging.WARNING, logging.INFO, logging.DEBUG)


def logs_to(verbose: int, file: str | None, form: Format) -> LogSettings:
    """Return the log settings from the options."""
    return LogSettings(LEVELS[min(verbose, 2)], form, Path(file) if file else None)


def serve(
    loaded: Loaded,
    out: Output,
    *,
    logs: LogSettings,
    started: Callable[[Edge], None],
    supervised: SupervisorClient | None = None,
    link: LinkRequest | None = None,
) -> ExitCode:
    """Run until Ctrl-C, SIGTERM or the end of the terminal; ``started`` is called with the built edge.

    ``link``: print such a link to the console, if fleet.yaml has one; its port may be any free one.
    """
    edge = loaded.config.edge
    kept = log_folder(state_folder(edge.id, edge.spool.path))
    logs.export()
    end_logs = start_logging(logs, kept / f"{MAIN}.jsonl")
    show_log(edge.id, kept, runtime_dir())
    if edge.realtime and not prefer_loop(os.getppid() if supervised is not None else 0):
        out.note(f"warning: {NOT_PERMITTED}")
    try:
        run_loop(_serve(loaded, out, started, supervised, link))
    finally:
        end_logs()
    return ExitCode.SOME_FAILED if loaded.problems else ExitCode.OK


async def _serve(
    loaded: Loaded,
    out: Output,
    started: Callable[[Edge], None],
    supervised: SupervisorClient | None,
    link: LinkRequest | None,
) -> None:
    """Run the edge and its live view."""
    edge = Edge(loaded, directory=runtime_dir(), clock=SystemClock(), supervised=supervised)
    ended = asyncio.Event()
    end_by_signal(ServeEnd(ended, time.monotonic, os._exit).requested)
    started(edge)
    beside = [asyncio.create_task(show(edge, out), name="view")]
    programs = [each for each in (_console(loaded, out, link), _recorder(loaded)) if each is not None]
    edge.beside = lambda: "; ".join(each.problem for each in programs if each.problem)
    beside += [asyncio.create_task(each.run(), name="beside") for each in programs]
    try:
        await edge.run(ended)
    finally:
        for task in beside:
            task.cancel()
        for outcome in await asyncio.gather(*beside, return_exceptions=True):
            if isinstance(outcome, Exception):
                raise outcome


def _console(loaded: Loaded, out: Output, link: LinkRequest | None) -> ConsoleChild | None:
    """Return the console from fleet.yaml, not started yet."""
    config = loaded.config
    if config.console is None:
        return None

    def served(address: str) -> None:
        out.note(
            f"console           {address}" if address else "console: fleet console --link  prints a link"
        )

    task = ConsoleTask(
        config.edge.id,
        config.console.port,
        link is not None,
        (bus_settings(config),),
        recordings=(str(folder_of(config)),),
        beside=str(state_folder(config.edge.id).parent),
        basemap=basemap_of(config),
        login=login_task(config),
    )
    return ConsoleChild(task, runtime_dir(), SystemClock(), requested=link, served=served)


def _recorder(loaded: Loaded) -> RecorderChild | None:
    """Return the recorder from fleet.yaml, not started yet."""
    wanted = loaded.config.record
    return RecorderChild(record_task(loaded.config, wanted), SystemClock()) if wanted is not None else None


class ServeEnd:
    """Handler of termination signals: the first sets ``ended``, a later one exits at once.

    Two signals in close succession count as one: a service manager signals every process of a service, and
    the supervisor also forwards its signal. ``clock`` is monotonic, in seconds.
    """

    def __init__(
        self, ended: asyncio.Event, clock: Callable[[], float], leave: Callable[[int], object]
    ) -> None:
        self._ended = ended
        self._clock = clock
        self._leave = leave
        self._first = 0.0

    def requested(self) -> None:
        """Handle a signal."""
        if not self._ended.is_set():
            self._first = self._clock()
            self._ended.set()
            with contextlib.suppress(OSError):  # the terminal may be gone
                sys.stderr.write(STOPPING)
        elif self._clock() - self._first > TOGETHER:
            self._leave(ExitCode.INTERRUPTED)
