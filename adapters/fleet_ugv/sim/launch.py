"""Simulated bases for ``sim:`` links: one subprocess that all simulated robots of a process share."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Any, Self

import msgspec

from fleet import LinkLost, LinkRefused
from fleet_ugv.sim.spec import SimSpec

_START = 30.0  # s that the subprocess may take to start and to answer
_STOP = 3.0


class SimProcess:
    """The simulator as a subprocess; an async context manager."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._asking = asyncio.Lock()

    async def __aenter__(self) -> Self:
        """Start the subprocess; raises LinkRefused when that is impossible."""
        try:
            self._process = await asyncio.create_subprocess_exec(
                sys.executable,
                *("-m", "fleet_ugv.sim", "--stdin"),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
            )
        except OSError as error:
            raise LinkRefused(f"the simulator cannot be started: {error}") from error
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the subprocess and wait for its end."""
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None
        process.stdin.close()
        try:
            await asyncio.wait_for(process.wait(), _STOP)
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    @contextlib.asynccontextmanager
    async def base(self, spec: SimSpec) -> AsyncIterator[str]:
        """Give the link of a new base, which goes when this ends.

        Raises LinkLost when the subprocess is gone, LinkRefused for a base that does not exist.
        """
        told = await self.ask({"add": spec})
        try:
            yield told["url"]
        finally:
            with contextlib.suppress(LinkLost, LinkRefused):
                await self.ask({"remove": {"url": told["url"]}})

    async def ask(self, line: Any) -> Any:
        """Send one line of ``fleet_ugv.sim.server`` and return the answer; raises LinkLost or LinkRefused."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise LinkLost("the simulator is not running")
        async with self._asking:
            if process.stdin.is_closing():
                raise LinkLost(f"the simulator ended with status {await process.wait()}")
            try:
                process.stdin.write(msgspec.json.encode(line) + b"\n")
                await process.stdin.drain()
                answer = await asyncio.wait_for(process.stdout.readline(), _START)
            except (OSError, TimeoutError) as error:
                raise LinkLost(f"the simulator does not answer: {error}") from error
        if not answer:
            raise LinkLost(f"the simulator ended with status {await process.wait()}")
        told = msgspec.json.decode(answer)
        if "error" in told:
            raise LinkRefused(f"the simulator refuses: {told['error']}")
        return told
