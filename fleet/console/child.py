"""The console as a child process of ``fleet run``, ``demo`` or ``console``: started, watched, started again.

It is no part of the robots' process: it may hang or die and no robot notices.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.console.links import LinkAsked, answers, ask_link
from fleet.console.task import ConsoleTask, link_socket
from fleet.host.logs.setup import FILE, FORM
from fleet.link.backoff import backoff
from fleet.plugins.probe import bare_environment

log = logging.getLogger(__name__)

START_WITHIN = 20.0  # s
LOOK = 0.05  # s between looks whether it serves
LEAVE_WITHIN = 6.0  # s; a console that just joins an edge waits for it
STABLE_AFTER = 30.0  # s of life after which the next restart is quick again
EXTRA = "the console needs its extra: pip install 'zenoh-fleet[console]' (here: uv sync --extra console)"


def is_installed() -> bool:
    """Return whether the packages of the extra are there."""
    return all(importlib.util.find_spec(name) for name in ("starlette", "uvicorn", "websockets"))


class ConsoleChild:
    """One console process.

    ``problem`` is what is wrong with it, empty while it serves; ``process`` its id, 0 before the first.
    ``served`` hears each time it begins to serve, with a link for ``asked`` where that is given.
    """

    def __init__(
        self,
        task: ConsoleTask,
        directory: Path,
        clock: Clock,
        *,
        asked: LinkAsked | None = None,
        served: Callable[[str], None] = lambda _link: None,
    ) -> None:
        self.problem = ""
        self.process = 0
        self._task = msgspec.structs.replace(task, parent=os.getpid())
        self._path = link_socket(directory, task.name)
        self._clock = clock
        self._asked = asked
        self._served = served

    async def run(self, *, again: bool = True) -> None:
        """Keep the console running until cancelled; without ``again``, until it ends."""
        if not is_installed():
            self.problem = EXTRA
            log.warning("%s", EXTRA)
            return
        waits = backoff(first=0.5, longest=10.0)
        while True:
            began = self._clock.monotonic()
            code = await self._once()
            self.problem = f"the console ended with exit code {code}"
            if not again:
                return
            log.error("%s; it is started again", self.problem)
            if self._clock.monotonic() - began > STABLE_AFTER:
                waits = backoff(first=0.5, longest=10.0)
            await asyncio.sleep(next(waits))

    async def _once(self) -> int:
        """Run the process once; return its exit code."""
        # A session of its own: a Ctrl-C on the terminal is for its parent, which ends it in order.
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "fleet.console.program"),
            stdin=asyncio.subprocess.PIPE,
            env=bare_environment() | {name: os.environ[name] for name in (FORM, FILE) if name in os.environ},
            start_new_session=True,
        )
        self.process = process.pid
        assert process.stdin is not None
        process.stdin.write(msgspec.json.encode(self._task))
        process.stdin.close()
        serving = asyncio.create_task(self._wait_served(process.pid))
        try:
            return await process.wait()
        finally:
            serving.cancel()
            await self._end(process)

    async def _wait_served(self, process: int) -> None:
        """Wait until this process serves, and tell."""
        end = self._clock.monotonic() + START_WITHIN
        while self._clock.monotonic() < end:
            link = await asyncio.to_thread(self._link_of, process)
            if link is not None:
                self.problem = ""
                self._served(link)
                return
            await asyncio.sleep(LOOK)
        self.problem = f"the console does not serve after {START_WITHIN:g} s"
        log.error("%s", self.problem)

    def _link_of(self, process: int) -> str | None:
        """Return a link of this process, empty where none is asked for; None while it does not serve."""
        if self._asked is None:
            return "" if answers(self._path) else None
        given = ask_link(self._path, self._asked)
        return given.link if given is not None and given.process == process else None

    async def _end(self, process: asyncio.subprocess.Process) -> None:
        """End the process in an orderly way, or by force."""
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        try:
            await asyncio.wait_for(process.wait(), LEAVE_WITHIN)
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
