"""Programs beside ``fleet run``, such as console and recorder: started, monitored, restarted.

Such a program is outside the robots' process: if it hangs or dies, no robot notices. The second part of this
module runs in the program itself: it ends with a signal or with its parent.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Callable, Coroutine

from fleet.clock import Clock
from fleet.host.logs.setup import PASSED_VARIABLES
from fleet.link.backoff import backoff
from fleet.plugins.probe import bare_environment

log = logging.getLogger(__name__)

FLUSH_TIMEOUT = 1.0  # s for reading the rest of an ended program's output
LEAVE_WITHIN = 6.0  # s to terminate; a program that is just joining an edge waits for it
STABLE_AFTER = 30.0  # s of life after which the next restart is quick again
PARENT_LOOK = 0.5  # s between checks that the parent is alive


class SideProgram:
    """One child process: ``python -m module``, which reads its task from its standard input.

    ``problem`` is its present problem, empty while it works; ``process`` its id, 0 before the first start.
    ``watch`` runs beside each process until it ends, and with ``heard`` reads its standard output.
    """

    def __init__(
        self,
        name: str,
        module: str,
        task: bytes,
        clock: Clock,
        watch: Callable[[asyncio.subprocess.Process], Coroutine[object, object, None]],
        *,
        heard: bool = False,
    ) -> None:
        self.problem = ""
        self.process = 0
        self._name = name
        self._module = module
        self._task = task
        self._clock = clock
        self._watch = watch
        self._heard = heard

    async def run(self, *, again: bool = True) -> None:
        """Keep the program running until cancelled; without ``again``, until it ends."""
        waits = backoff(first=0.5, longest=10.0)
        while True:
            began = self._clock.monotonic()
            code = await self._once()
            self.problem = f"the {self._name} ended with exit code {code}"
            if not again:
                return
            log.error("%s; it is started again", self.problem)
            if self._clock.monotonic() - began > STABLE_AFTER:
                waits = backoff(first=0.5, longest=10.0)
            await asyncio.sleep(next(waits))

    async def _once(self) -> int:
        """Run the process once; return its exit code."""
        # A session of its own: Ctrl-C on the terminal goes to its parent, which ends it in order.
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", self._module),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE if self._heard else None,
            env=bare_environment()
            | {name: os.environ[name] for name in PASSED_VARIABLES if name in os.environ},
            start_new_session=True,
        )
        self.process = process.pid
        assert process.stdin is not None
        process.stdin.write(self._task)
        process.stdin.close()
        watching = asyncio.create_task(self._watch(process), name=f"watch:{self._name}")
        try:
            code = await process.wait()
            if self._heard:  # the rest of its output may be unread
                await asyncio.wait({watching}, timeout=FLUSH_TIMEOUT)
            return code
        finally:
            watching.cancel()
            await self._end(process)

    async def _end(self, process: asyncio.subprocess.Process) -> None:
        """Terminate the process, or kill it after ``LEAVE_WITHIN``."""
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        try:
            async with asyncio.timeout(LEAVE_WITHIN):
                await process.wait()
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()


async def until_ended(
    parent: int, work: Callable[[asyncio.Event], Coroutine[object, object, object]]
) -> None:
    """Run ``work`` with an event that is set by a signal, or when ``parent`` (0: none) is gone."""
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, ended.set)
    watching = asyncio.create_task(_watch_parent(parent, ended), name="parent")
    try:
        await work(ended)
    finally:
        watching.cancel()


async def _watch_parent(parent: int, ended: asyncio.Event) -> None:
    """Set ``ended`` when the parent is gone."""
    while parent and not ended.is_set():
        if os.getppid() != parent:
            ended.set()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(PARENT_LOOK):
                await ended.wait()
