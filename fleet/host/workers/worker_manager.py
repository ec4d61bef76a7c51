"""Worker processes of the edge: started, monitored, and restarted when they die or hang.

A killed worker is detected by its exit, a frozen one by its liveliness token, which expires after 1 s, and
one with a hanging event loop by its missing heartbeat. A hanging worker gets a halt over the bus, which its
bus threads still receive, before it is killed; otherwise the robots' own fail-safes stop them.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.host.logs.setup import PASSED_VARIABLES
from fleet.host.workers.reload import RELOADED
from fleet.link.backoff import backoff
from fleet.plugins.probe import bare_environment
from fleet.runtime.exception_barrier import log_exceptions
from fleet.supervisor.sockets import VARIABLE

log = logging.getLogger(__name__)

START_WITHIN = 60.0  # s from the start of the process to its first heartbeat; an overloaded computer takes 15
SILENT_AFTER = 1.5  # s without a heartbeat after which a worker counts as hung
POLL_INTERVAL = 0.25  # s between checks
HALT_WITHIN = 0.5  # s for a hanging worker to halt its robots before it is killed
_RELOADS = "starts again with what was changed"
LEAVE_WITHIN = 10.0  # s for a worker to stop its robots and end
STABLE_AFTER = 30.0  # s of life after which the next restart is quick again


class WorkerManager:
    """One worker process.

    ``task`` is all that it gets: neither fleet.yaml nor the edge's environment. ``on_problem`` is called with
    the problem of the worker, empty when it runs; ``halt`` stops its robots over the bus.
    """

    def __init__(
        self,
        name: str,
        *,
        edge: str,
        task: bytes,
        directory: Path,
        control: ZenohSession,
        clock: Clock,
        on_problem: Callable[[str, str], None],
        halt: Callable[[str], None],
    ) -> None:
        self.name = name
        self._command = (
            *(sys.executable, "-P", "-m", "fleet.host.workers.worker_process"),
            *("--directory", str(directory), "--parent", str(os.getpid())),
        )
        self._task = task
        self._clock = clock
        kept = log_exceptions(log, f"worker {name}: a problem of it could not be reported")
        self._on_problem = kept(on_problem)
        self._halt = log_exceptions(log, f"worker {name}: its robots could not be halted over the bus")(halt)
        self.started = 0  # number of processes that have come up
        self.given = b""  # task of the last process that was started
        self._beat = 0.0
        self._gone = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._ends = (
            control.subscribe(keys.heartbeat(edge, name), self._beaten),
            control.watch_tokens(keys.worker(edge, name), self._token_changed),
        )

    def close(self) -> None:
        """Unsubscribe, after the worker has ended."""
        for end in self._ends:
            end()

    def replace(self, task: bytes) -> bytes:
        """Set the task of the next process; return the task before."""
        before, self._task = self._task, task
        return before

    async def run(self) -> None:
        """Keep the worker running until cancelled."""
        waits = backoff(first=0.2, longest=5.0)
        while True:
            began = self._clock.monotonic()
            cause = await self._once()
            if cause == _RELOADS:
                log.info("worker %s: %s", self.name, cause)
                continue
            log.error("worker %s: %s; it is started again", self.name, cause)
            if self._clock.monotonic() - began > STABLE_AFTER:
                waits = backoff(first=0.2, longest=5.0)
            await asyncio.sleep(next(waits))

    async def _once(self) -> str:
        """Run the process once; return why it ended."""
        self._beat = 0.0
        self._gone.clear()
        try:
            # A session of its own: Ctrl-C on the terminal goes to the edge, which ends its workers in order.
            process = await asyncio.create_subprocess_exec(
                *self._command,
                stdin=asyncio.subprocess.PIPE,
                env=_environment(),
                start_new_session=True,
            )
        except OSError as error:
            return self._report(f"cannot be started: {error.strerror}")
        assert process.stdin is not None
        self.given = self._task
        process.stdin.write(self.given)
        process.stdin.close()
        exited = asyncio.ensure_future(process.wait())
        try:
            cause = self._report(await self._watch(exited))
            await self._give_up(process, exited)
        except asyncio.CancelledError:
            await self._end(process, exited)
            raise
        return cause

    def _report(self, cause: str) -> str:
        """Report a problem, and return it."""
        self._on_problem(self.name, f"worker {self.name}: {cause}")
        return cause

    async def _watch(self, exited: asyncio.Future[int]) -> str:
        """Wait until the process ends or hangs; return which."""
        looked = self._clock.monotonic()
        deadline = looked + START_WITHIN
        running = False
        while True:
            done, _ = await asyncio.wait({exited}, timeout=POLL_INTERVAL)
            if done and exited.result() == RELOADED:
                return _RELOADS
            if done:
                return f"ended with exit code {exited.result()}"
            now = self._clock.monotonic()
            if self._beat and not running:
                running = True
                self.started += 1
                self._on_problem(self.name, "")
            if now - looked > 2 * POLL_INTERVAL:
                # This process was asleep itself; heartbeats that arrived meanwhile may not be processed yet.
                deadline += now - looked
                self._beat = now if running else self._beat
            looked = now
            if self._gone.is_set() and running:
                return "vanished from the bus (frozen or killed)"
            if (running and now - self._beat > SILENT_AFTER) or (not running and now > deadline):
                return "hangs: its event loop is blocked" if running else "did not start in time"

    async def _give_up(self, process: asyncio.subprocess.Process, exited: asyncio.Future[int]) -> None:
        """Halt the robots of a hanging process, and kill it."""
        if exited.done():
            return
        self._halt(self.name)
        await asyncio.wait({exited}, timeout=HALT_WITHIN)
        _signal(process.kill)
        await exited

    async def _end(self, process: asyncio.subprocess.Process, exited: asyncio.Future[int]) -> None:
        """Terminate the process, or kill it after ``LEAVE_WITHIN``."""
        _signal(process.terminate)
        done, _ = await asyncio.wait({exited}, timeout=LEAVE_WITHIN)
        if not done:
            log.error("worker %s did not end within %g s: killed", self.name, LEAVE_WITHIN)
            _signal(process.kill)
            await exited

    def _beaten(self, _key: str, _payload: bytes) -> None:
        """Record a heartbeat; on the bus's thread."""
        self._beat = self._clock.monotonic()

    def _token_changed(self, _key: str, alive: bool) -> None:  # noqa: FBT001 - signature of the bus
        """Record that the worker appeared (its first sign of life) or is gone; on the bus's thread."""
        if alive:
            self._beat = self._clock.monotonic()
        self._loop.call_soon_threadsafe(self._gone.clear if alive else self._gone.set)


def _environment() -> dict[str, str]:
    """Return the environment of a worker: its supervisor and its log settings, but no secrets."""
    given = bare_environment()
    given |= {name: os.environ[name] for name in (VARIABLE, *PASSED_VARIABLES) if name in os.environ}
    return given


def _signal(send: Callable[[], None]) -> None:
    """Send a process a signal; it may have ended by itself."""
    with contextlib.suppress(ProcessLookupError):
        send()


def names_of(workers: Iterable[str]) -> list[str]:
    """Return the workers to start, each once, sorted."""
    return sorted({name for name in workers if name})
