"""``fleet run --watch``: reloads a drop-in file whenever it is saved, for its author.

Only files of workers, which are restarted; never the edge's own process. A worker with a real robot that is
not at rest goes on with the old file, and is asked again until it is; simulated robots do not wait. A worker
that refuses the file, or does not answer, is asked again as well, at growing intervals.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path

import msgspec

from fleet.config.load import Loaded
from fleet.host.process.component_settings import worker_of

log = logging.getLogger(__name__)

POLL_INTERVAL = 0.5  # s between checks; a file counts as saved once two of them see the same

FIRST, LONGEST = 10, 120  # checks until a worker that refuses is asked again

ReloadWorker = Callable[[str, str, bool], Awaitable[str]]
"""Makes a worker reload an adapter's file, by force or at rest; returns why it does not."""


class WatchedFile(msgspec.Struct, frozen=True):
    """A drop-in file: its adapter, the worker that runs it, and whether all robots there are simulated."""

    path: Path
    adapter: str
    worker: str
    simulated: bool


def watched_files(loaded: Loaded) -> list[WatchedFile]:
    """Return the drop-in files that run in workers of this edge."""
    workers: dict[str, bool] = {}
    for robot, plugin in loaded.robots:
        name = worker_of(robot, plugin)
        workers[name] = workers.get(name, True) and robot.simulated
    found = {
        (plugin.file, plugin.name, worker): None
        for robot, plugin in loaded.robots
        if plugin.file is not None
        and (worker := worker_of(robot, plugin))
        and worker not in loaded.config.remote_workers
    }
    return [WatchedFile(path, adapter, worker, workers[worker]) for path, adapter, worker in found]


class DropInWatch:
    """Checks the files, and asks their workers; ``blocker`` returns which of a worker's robots moves."""

    def __init__(
        self, files: Iterable[WatchedFile], request: ReloadWorker, blocker: Callable[[str], str]
    ) -> None:
        self._request, self._blocker = request, blocker
        self._seen = {file: _stamp(file.path) for file in files}
        self._in_use = dict(self._seen)
        self._reported: dict[WatchedFile, str] = {}
        self._polls = 0
        self._again: dict[WatchedFile, _NextAttempt] = {}

    async def run(self) -> None:
        """Check until cancelled."""
        while True:
            await asyncio.sleep(POLL_INTERVAL)
            await self.poll()

    async def poll(self) -> None:
        """Check once: reload each file that was saved and is no longer being written."""
        self._polls += 1
        for file, before in list(self._seen.items()):
            now = self._seen[file] = _stamp(file.path)
            if now != before:
                self._again.pop(file, None)
            elif now is not None and now != self._in_use[file] and self._is_due(file):
                await self._reload(file, now)

    def _is_due(self, file: WatchedFile) -> bool:
        """Return whether a worker is asked now."""
        return file not in self._again or self._polls >= self._again[file].at

    async def _reload(self, file: WatchedFile, stamp: tuple[int, int]) -> None:
        """Reload a file; a failure is logged once."""
        waits = "" if file.simulated else self._blocker(file.worker)
        why = waits or await self._requested(file)
        if not why:
            log.warning("%s: taken into use by worker %s", file.path, file.worker)
        elif why != self._reported.get(file):
            log.warning("%s: not taken into use%s: %s", file.path, " yet" if waits else "", why)
        self._reported[file] = why
        if not why:
            self._in_use[file] = stamp
        elif not waits:
            pause = min(2 * self._again[file].pause, LONGEST) if file in self._again else FIRST
            self._again[file] = _NextAttempt(pause, self._polls + pause)

    async def _requested(self, file: WatchedFile) -> str:
        """Ask a worker; return why it does not reload the file, or cannot be asked."""
        try:
            return await self._request(file.worker, file.adapter, file.simulated)
        except Exception as error:
            log.exception("worker %s could not be asked", file.worker)
            return f"worker {file.worker} could not be asked: {type(error).__name__}: {error}"


class _NextAttempt(msgspec.Struct, frozen=True):
    """Next attempt for a worker that refused, and the interval before it, in checks."""

    pause: int
    at: int


def _stamp(path: Path) -> tuple[int, int] | None:
    """Return a value that changes when a file is saved; None while there is no file."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
