"""``fleet run --watch``: a drop-in file that was saved is taken into use, for those who write one.

Only files of workers, which start again; never the edge's own process. A worker with a real robot that does
not rest goes on with the old file, and is asked again until it rests; simulated robots do not wait.
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

    async def run(self) -> None:
        """Look until cancelled."""
        while True:
            await asyncio.sleep(LOOK)
            await self.look()

    async def look(self) -> None:
        """Look once: what has been saved since, and is not being written still, is taken into use."""
        for file, before in list(self._seen.items()):
            now = self._seen[file] = _stamp(file.path)
            if now is not None and now == before and now != self._in_use[file]:
                await self._take(file, now)

    async def _take(self, file: WatchedFile, stamp: tuple[int, int]) -> None:
        """Have a file taken into use; why not is told once."""
        waits = "" if file.simulated else self._hindrance(file.worker)
        why = waits or await self._ask(file.worker, file.adapter, file.simulated)
        if not why:
            log.warning("%s: taken into use by worker %s", file.path, file.worker)
        elif why != self._told.get(file):
            log.warning("%s: not taken into use%s: %s", file.path, " yet" if waits else "", why)
        self._told[file] = why
        if not waits:
            self._in_use[file] = stamp


def _stamp(path: Path) -> tuple[int, int] | None:
    """Return what changes when a file is saved; None while there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
