"""A window of the recordings as a file for a browser: by a process of its own, one at a time, on no disk."""

from __future__ import annotations

import asyncio
import logging
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Callable, Iterable
from pathlib import Path

import msgspec

from fleet.console.sessions import Operator
from fleet.errors import Refused
from fleet.model.permission import Permission
from fleet.record.child import EXTRA, is_installed
from fleet.record.export_task import ExportTask
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

NEEDED = Permission.ADMIN
"""A file has positions, names of people, and the bytes on the links of robots."""
LONGEST = 1800.0  # s of a window
SILENT = 60.0  # s without a byte from the process
WITHIN = 600.0  # s for the whole file, also for a browser that does not read
BLOCK = 64 * 1024  # bytes
COMMAND = (sys.executable, "-P", "-m", "fleet.record.export_program")


class Window(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is asked for: what was received from ``since`` until before ``until``, Unix s."""

    since: float
    until: float


class Exports:
    """Exports the recordings in ``folders``."""

    def __init__(self, folders: Callable[[], Iterable[Path]]) -> None:
        self._folders = folders
        self._process: Process | None = None

    async def export(self, window: Window, operator: Operator) -> AsyncIterator[bytes]:
        """Return the file of a window, block by block; raises Refused."""
        if why := operator.permission.refusal(NEEDED):
            raise Refused(why)
        if not 0 <= window.since < window.until <= window.since + LONGEST:
            raise Refused(f"a window begins before it ends, and has {LONGEST / 60:g} min at most")
        if not is_installed():
            raise Refused(EXTRA)
        if self._process is not None and self._process.returncode is None:
            raise Refused("another window is being exported", hint="wait for its end")
        log.info("%s exports the recording from %s until %s", operator.name, window.since, window.until)
        there = tuple(str(folder) for folder in self._folders() if folder.is_dir())
        process = await asyncio.create_subprocess_exec(*COMMAND, stdin=PIPE, stdout=PIPE)
        self._process = process
        asyncio.get_running_loop().call_later(WITHIN, _kill, process)
        try:
            await _begin(process, ExportTask(there, window.since, window.until))
        except BaseException:
            await _end(process)
            raise
        return _blocks(process)


async def _blocks(process: Process) -> AsyncIterator[bytes]:
    """Yield what the process writes; it ends with whoever reads that."""
    assert process.stdout is not None
    try:
        while block := await asyncio.wait_for(process.stdout.read(BLOCK), SILENT):
            yield block
        if await process.wait():
            raise OSError("the process that exports has failed")
    finally:
        await _end(process)


async def _end(process: Process) -> None:
    """End the process, and wait for its end."""
    _kill(process)
    await process.wait()


def _kill(process: Process) -> None:
    """End the process, if it runs still."""
    if process.returncode is None:
        process.kill()


async def _begin(process: Process, task: ExportTask) -> None:
    """Give the process its task, and wait until it can write the file; raises Refused."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(msgspec.json.encode(task))
        process.stdin.close()
        problem = decode_json(await asyncio.wait_for(process.stdout.readline(), SILENT), str)
    except (OSError, ValueError, TimeoutError, msgspec.DecodeError):
        problem = "the process that exports has failed"
    if problem:
        raise Refused(problem)
