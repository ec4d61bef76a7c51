"""``fleet run --watch``: a drop-in file that was saved is taken into use, for those who write one.

Only files of workers, which start again; never the edge's own process. A worker with a real robot that does
not rest goes on with the old file, and is asked again until it rests; simulated robots do not wait. One that
does not take the file, or does not answer, is asked again as well, each time after a longer while.
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

LOOK = 0.5  # s between looks; a file counts as saved once two of them see the same

FIRST, LONGEST = 10, 120  # looks until a worker that refuses is asked again

Ask = Callable[[str, str, bool], Awaitable[str]]
"""Have a worker take the file of an adapter into use, by force or at rest; returns why it does not."""


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
    """Looks at the files, and asks their workers; ``hindrance`` says which of a worker's robots moves."""

    def __init__(self, files: Iterable[WatchedFile], ask: Ask, hindrance: Callable[[str], str]) -> None:
        self._ask, self._hindrance = ask, hindrance
        self._seen = {file: _stamp(file.path) for file in files}
        self._in_use = dict(self._seen)
        self._told: dict[WatchedFile, str] = {}
        self._looks = 0
        self._again: dict[WatchedFile, _Again] = {}

    async def run(self) -> None:
        """Look until cancelled."""
        while True:
            await asyncio.sleep(LOOK)
            await self.look()

    async def look(self) -> None:
        """Look once: what has been saved since, and is not being written still, is taken into use."""
        self._looks += 1
        for file, before in list(self._seen.items()):
            now = self._seen[file] = _stamp(file.path)
            if now != before:
                self._again.pop(file, None)
            elif now is not None and now != self._in_use[file] and self._is_due(file):
                await self._take(file, now)

    def _is_due(self, file: WatchedFile) -> bool:
        """Return whether a worker is asked now."""
        return file not in self._again or self._looks >= self._again[file].at

    async def _take(self, file: WatchedFile, stamp: tuple[int, int]) -> None:
        """Have a file taken into use; why not is told once."""
        waits = "" if file.simulated else self._hindrance(file.worker)
        why = waits or await self._asked(file)
        if not why:
            log.warning("%s: taken into use by worker %s", file.path, file.worker)
        elif why != self._told.get(file):
            log.warning("%s: not taken into use%s: %s", file.path, " yet" if waits else "", why)
        self._told[file] = why
        if not why:
            self._in_use[file] = stamp
        elif not waits:
            pause = min(2 * self._again[file].pause, LONGEST) if file in self._again else FIRST
            self._again[file] = _Again(pause, self._looks + pause)

    async def _asked(self, file: WatchedFile) -> str:
        """Ask a worker; return why it does not take the file, or cannot be asked."""
        try:
            return await self._ask(file.worker, file.adapter, file.simulated)
        except Exception as error:
            log.exception("worker %s could not be asked", file.worker)
            return f"worker {file.worker} could not be asked: {type(error).__name__}: {error}"


class _Again(msgspec.Struct, frozen=True):
    """When a worker that refused is asked again, in looks, and how long after it was asked that is."""

    pause: int
    at: int


def _stamp(path: Path) -> tuple[int, int] | None:
    """Return what changes when a file is saved; None while there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
