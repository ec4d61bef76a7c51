"""A simulator in a subprocess, shared by the ``sim:`` links of one process."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Any, Never, Self

import msgspec

from fleet.errors import LinkLost, LinkRefused

_START = 30.0  # s within which the subprocess must start and answer
_STOP = 3.0


class SimProcess:
    """A running ``python -m MODULE --stdin``, a ``fleet.sim.server``; an async context manager."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._process: asyncio.subprocess.Process | None = None
        self._requesting = asyncio.Lock()
        self._unread = 0  # answers that are to come, also to requests whose sender was cancelled

    async def __aenter__(self) -> Self:
        """Start the subprocess; raises LinkRefused if that is impossible."""
        try:
            self._process = await asyncio.create_subprocess_exec(
                sys.executable,
                *("-m", self._module, "--stdin"),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                start_new_session=True,  # Ctrl-C at the terminal is for the edge, which ends it in order
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
            async with asyncio.timeout(_STOP):
                await process.wait()
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    @contextlib.asynccontextmanager
    async def robot(self, spec: object) -> AsyncIterator[str]:
        """Yield the link of a new simulated robot, which is removed at the end of the block.

        Raises LinkLost if the subprocess is gone, LinkRefused for an invalid specification.
        """
        url = (await self.request({"add": spec}))["url"]
        try:
            yield url
        finally:
            with contextlib.suppress(LinkLost, LinkRefused):
                await self.request({"remove": {"url": url}})

    async def fault(self, url: str, name: str, value: float | None = 1.0) -> None:
        """Start a fault of the robot behind a link; None ends it. Raises LinkLost or LinkRefused."""
        await self.request({"fault": {"url": url, "name": name, "value": value}})

    async def lost(self) -> Never:
        """Wait until the subprocess ends, then raise LinkLost."""
        raise LinkLost(f"the simulator ended with status {await self._running().wait()}")

    def _running(self) -> asyncio.subprocess.Process:
        """Return the subprocess; raises LinkLost if there is none."""
        if self._process is None:
            raise LinkLost("the simulator is not running")
        return self._process

    async def request(self, line: object) -> Any:
        """Send one line of ``fleet.sim.server`` and return the answer; raises LinkLost or LinkRefused."""
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        async with self._requesting:
            if process.stdin.is_closing():
                raise LinkLost(f"the simulator ended with status {await process.wait()}")
            answer = b""
            try:
                process.stdin.write(msgspec.json.encode(line) + b"\n")
                self._unread += 1
                await process.stdin.drain()
                async with asyncio.timeout(_START):
                    while self._unread:
                        answer = await process.stdout.readline()
                        self._unread -= 1
            except TimeoutError as error:
                raise LinkLost(f"the simulator does not answer within {_START:g} s") from error
            except OSError as error:
                raise LinkLost(f"the simulator does not answer: {error}") from error
        if not answer:
            raise LinkLost(f"the simulator ended with status {await process.wait()}")
        decoded = msgspec.json.decode(answer)
        if "error" in decoded:
            raise LinkRefused(f"the simulator refuses: {decoded['error']}")
        return decoded
