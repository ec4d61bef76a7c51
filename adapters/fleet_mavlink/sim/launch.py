"""Simulated vehicles for ``sim:`` links: one subprocess that all simulated robots of a process share."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from types import TracebackType
from typing import Any, Self

import msgspec

from fleet.errors import LinkLost, LinkRefused
from fleet_mavlink.sim.spec import SimSpec

__all__ = ["SimProcess", "SimSpec"]

_START = 30.0  # seconds that the subprocess may take to start and to answer
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
                *("-m", "fleet_mavlink.sim", "--stdin", "--vehicles", "0"),
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
        process = self._process
        self._process = None
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

    async def add(self, spec: SimSpec) -> str:
        """Add a vehicle; return the link to open: it waits on its own UDP port to be heard.

        Raises LinkLost when the subprocess is gone.
        """
        told = await self._ask({"add": spec})
        return f"udpout:127.0.0.1:{told['added']['port']}"

    async def fault(self, link: str, name: str, value: float | None = 1.0) -> None:
        """Begin a fault of the vehicle behind a link that ``add`` returned; None ends it.

        Raises ValueError for a fault that does not exist, LinkLost when the subprocess is gone.
        """
        port = int(link.rpartition(":")[2])
        await self._ask({"fault": {"port": port, "name": name, "value": value}})

    async def lost(self) -> None:
        """Wait until the subprocess ends, then raise LinkLost."""
        process = self._running()
        status = await process.wait()
        raise LinkLost(f"the simulator ended with status {status}")

    def _running(self) -> asyncio.subprocess.Process:
        if self._process is None:
            raise LinkLost("the simulator is not running")
        return self._process

    async def _ask(self, line: Any) -> Any:
        """Send one line and return the answer."""
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
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
            raise ValueError(told["error"])
        return told
