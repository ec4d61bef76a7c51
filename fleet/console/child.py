"""The console as a child process of ``fleet run``, ``demo`` or ``console``: start, monitor, restart.

It is separate from the robots' process: it may hang or die without any effect on robots.
"""

from __future__ import annotations

import asyncio
import importlib.util
import logging
import os
from collections.abc import Callable
from pathlib import Path

import msgspec

from fleet.clock import Clock
from fleet.console.login_links import LinkRequest, answers, request_link
from fleet.console.task import ConsoleTask, link_socket
from fleet.host.process.side_program import SideProgram

log = logging.getLogger(__name__)

START_WITHIN = 60.0  # s; an overloaded computer takes 15
POLL_INTERVAL = 0.05  # s between checks whether it serves
EXTRA = "the console needs its extra: pip install 'zenoh-fleet[console]' (here: uv sync --extra console)"


def is_installed() -> bool:
    """Return True if the packages of the extra are installed."""
    return all(importlib.util.find_spec(name) for name in ("argon2", "starlette", "uvicorn", "websockets"))


class ConsoleChild:
    """One console process.

    ``problem`` is its error, empty while it serves; ``process`` is its id, 0 before the first start.
    ``served`` is called each time it begins to serve, with a link for ``requested`` if given.
    """

    def __init__(
        self,
        task: ConsoleTask,
        directory: Path,
        clock: Clock,
        *,
        requested: LinkRequest | None = None,
        served: Callable[[str], None] = lambda _link: None,
    ) -> None:
        encoded_task = msgspec.json.encode(msgspec.structs.replace(task, parent=os.getpid()))
        self._program = SideProgram(
            "console", "fleet.console.program", encoded_task, clock, self._wait_served
        )
        self._path = link_socket(directory, task.name)
        self._clock = clock
        self._requested = requested
        self._served = served

    @property
    def problem(self) -> str:
        """Its error; empty while it serves."""
        return self._program.problem

    @property
    def process(self) -> int:
        """The id of its process."""
        return self._program.process

    async def run(self, *, again: bool = True) -> None:
        """Keep the console running until cancelled; without ``again``, until it ends."""
        if not is_installed():
            self._program.problem = EXTRA
            log.warning("%s", EXTRA)
            return
        await self._program.run(again=again)

    async def _wait_served(self, process: asyncio.subprocess.Process) -> None:
        """Wait until this process serves, and call ``served``."""
        end = self._clock.monotonic() + START_WITHIN
        while self._clock.monotonic() < end:
            link = await asyncio.to_thread(self._link_of, process.pid)
            if link is not None:
                self._program.problem = ""
                self._served(link)
                return
            await asyncio.sleep(POLL_INTERVAL)
        self._program.problem = f"the console does not serve after {START_WITHIN:g} s"
        log.error("%s", self._program.problem)

    def _link_of(self, process: int) -> str | None:
        """Return a link of this process, empty if none is requested; None while it does not serve."""
        if self._requested is None:
            return "" if answers(self._path) else None
        given = request_link(self._path, self._requested)
        return given.link if given is not None and given.process == process else None
