"""Export of a window of the recordings to a browser: by a separate process, one at a time, without a file."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from pathlib import Path

import msgspec

from fleet.console.sessions import ConsoleUser
from fleet.errors import Refused
from fleet.model.permission import Permission
from fleet.record.child import EXTRA, is_installed
from fleet.record.export_task import ExportTask
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

NEEDED = Permission.ADMIN
"""A file contains positions, names of people, and the bytes on the links of robots."""
LONGEST = 1800.0  # s of a window
SILENT = 60.0  # s without a byte from the process
WITHIN = 600.0  # s for the whole file, also if the browser does not read
BLOCK = 64 * 1024  # bytes
COMMAND = (sys.executable, "-P", "-m", "fleet.record.export_program")


class ExportWindow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request for the messages received from ``since`` until before ``until``, Unix s."""

    since: float
    until: float


class Export:
    """A window being exported; its owner must ``end`` it, even if nothing of it was read."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self._timer = asyncio.get_running_loop().call_later(WITHIN, _kill, process)

    async def begin(self, task: ExportTask) -> None:
        """Send the task to the process, and wait until it can write the file; raises Refused."""
        await _begin(self._process, task)

    async def blocks(self) -> AsyncIterator[bytes]:
        """Yield the output of the process."""
        assert self._process.stdout is not None
        while block := await _in_time(self._process.stdout.read(BLOCK)):
            yield block
        if await self._process.wait():
            raise OSError("the process that exports has failed")

    async def end(self) -> None:
        """Kill the process, and wait for its end."""
        self._timer.cancel()
        _kill(self._process)
        await self._process.wait()


class Exports:
    """Exports the recordings in ``folders``."""

    def __init__(self, folders: Callable[[], Iterable[Path]]) -> None:
        self._folders = folders
        self._is_busy = False

    @contextlib.asynccontextmanager
    async def export(self, window: ExportWindow, operator: ConsoleUser) -> AsyncIterator[Export]:
        """Export a window while the context lasts, its file in blocks; raises Refused."""
        if why := operator.permission.refusal(NEEDED):
            raise Refused(why)
        if not 0 <= window.since < window.until <= window.since + LONGEST:
            raise Refused(f"a window begins before it ends, and has {LONGEST / 60:g} min at most")
        if not is_installed():
            raise Refused(EXTRA)
        if self._is_busy:
            raise Refused("another window is being exported", hint="wait for its end")
        # set before the process starts, which takes a while in which other requests may arrive
        self._is_busy = True
        try:
            log.info("%s exports the recording from %s until %s", operator.name, window.since, window.until)
            there = tuple(str(folder) for folder in self._folders() if folder.is_dir())
            export = Export(await asyncio.create_subprocess_exec(*COMMAND, stdin=PIPE, stdout=PIPE))
            try:
                await export.begin(ExportTask(there, window.since, window.until))
                yield export
            finally:
                await export.end()
        finally:
            self._is_busy = False


def _kill(process: Process) -> None:
    """Kill the process, if it still runs."""
    if process.returncode is None:
        process.kill()


async def _in_time(output: Awaitable[bytes]) -> bytes:
    """Return output of the process; raises TimeoutError if it is silent."""
    async with asyncio.timeout(SILENT):
        return await output


async def _begin(process: Process, task: ExportTask) -> None:
    """Send the task to the process, and wait until it can write the file; raises Refused."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(msgspec.json.encode(task))
        process.stdin.close()
        problem = decode_json(await _in_time(process.stdout.readline()), str)
    except (OSError, ValueError, TimeoutError, msgspec.DecodeError):
        problem = "the process that exports has failed"
    if problem:
        raise Refused(problem)
