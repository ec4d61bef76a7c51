"""The edge's worker processes: started, watched, and started again when they die or hang.

A worker that was killed drops its liveliness token within milliseconds, a frozen one within the lease (1 s);
one whose event loop hangs stops beating. Its robots' own fail-safes stop them meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from fleet.bus import keys
from fleet.bus.lane import Lane
from fleet.clock import Clock
from fleet.link.backoff import backoff

log = logging.getLogger(__name__)

START_WITHIN = 20.0  # s from the start of the process to its first beat
SILENT_AFTER = 1.5  # s without a beat after which a worker counts as hung
LOOK = 0.25  # s between looks
LEAVE_WITHIN = 10.0  # s that a worker gets to stop its robots and end
STABLE_AFTER = 30.0  # s of life after which the next restart is quick again


class Worker:
    """One worker process. ``told`` hears what is wrong with it, and an empty text when it runs."""

    def __init__(
        self,
        name: str,
        *,
        edge: str,
        config: Path,
        directory: Path,
        control: Lane,
        clock: Clock,
        told: Callable[[str, str], None],
    ) -> None:
        self.name = name
        self._command = (
            sys.executable,
            "-m",
            "fleet.host.worker",
            *("--name", name, "--config", str(config), "--directory", str(directory)),
        )
        self._clock = clock
        self._told = told
        self._beat = 0.0
        self._gone = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        control.subscribe(keys.heartbeat(edge, name), self._beaten)
        control.watch_tokens(keys.worker(edge, name), self._token_changed)

    async def run(self) -> None:
        """Keep the worker running until cancelled."""
        waits = backoff(first=0.2, longest=5.0)
        while True:
            began = self._clock.monotonic()
            cause = await self._once()
            log.error("worker %s: %s; its robots are offline until it is back", self.name, cause)
            self._told(self.name, f"worker {self.name}: {cause}")
            if self._clock.monotonic() - began > STABLE_AFTER:
                waits = backoff(first=0.2, longest=5.0)
            await asyncio.sleep(next(waits))

    async def _once(self) -> str:
        """Run the process once; return why it ended."""
        self._beat = 0.0
        self._gone.clear()
        process = await asyncio.create_subprocess_exec(*self._command, stdin=asyncio.subprocess.DEVNULL)
        exited = asyncio.ensure_future(process.wait())
        try:
            cause = await self._watch(exited)
        except asyncio.CancelledError:
            await self._end(process, exited)
            raise
        if not exited.done():
            process.kill()
            await exited
        return cause

    async def _watch(self, exited: asyncio.Future[int]) -> str:
        """Wait until the process ends or hangs; return which."""
        deadline = self._clock.monotonic() + START_WITHIN
        running = False
        while True:
            with contextlib.suppress(TimeoutError):
                code = await asyncio.wait_for(asyncio.shield(exited), LOOK)
                return f"ended with exit code {code}"
            now = self._clock.monotonic()
            if self._beat and not running:
                running = True
                self._told(self.name, "")
            if self._gone.is_set() and running:
                return "vanished from the bus (frozen or killed)"
            if (running and now - self._beat > SILENT_AFTER) or (not running and now > deadline):
                return "hangs: its event loop does not turn" if running else "did not start in time"

    async def _end(self, process: asyncio.subprocess.Process, exited: asyncio.Future[int]) -> None:
        """End the process in an orderly way, or by force."""
        if not exited.done():
            process.terminate()
        try:
            await asyncio.wait_for(asyncio.shield(exited), LEAVE_WITHIN)
        except TimeoutError:
            log.error("worker %s did not end within %g s: killed", self.name, LEAVE_WITHIN)  # noqa: TRY400
            process.kill()
            await exited

    def _beaten(self, _key: str, _payload: bytes) -> None:
        """Note a beat; on the bus's thread."""
        self._beat = self._clock.monotonic()

    def _token_changed(self, _key: str, alive: bool) -> None:  # noqa: FBT001 - the bus calls it so
        """Note that the worker came or went; on the bus's thread."""
        self._loop.call_soon_threadsafe(self._gone.clear if alive else self._gone.set)


def names_of(workers: Iterable[str]) -> list[str]:
    """Return the workers to start, each once, in a steady order."""
    return sorted({name for name in workers if name})
