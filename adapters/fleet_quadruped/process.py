"""The body controller as a subprocess: shared memory for orders and states, a message when it ends."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys
from types import TracebackType
from typing import Self

import msgspec

from fleet import LinkLost, LinkRefused, decode_json
from fleet_quadruped.config import QuadrupedConfig, simulation
from fleet_quadruped.control.exchange import SharedValue, new_memory
from fleet_quadruped.control.orders import DogState, Order
from fleet_quadruped.control.task import ControlTask, StatusMessage

_START = 30.0  # s until it must be ready

DISMISSED = b"leave\n"
"""Written before the pipe is closed: distinguishes an orderly end from the death of this process."""


class BodyProcess:
    """A running body controller; an async context manager that leaves the robot sitting, its drives off.

    ``leave``: seconds that it may take to sit the robot down. ``relay``: socket for the frames of its buses.
    """

    def __init__(self, config: QuadrupedConfig, leave: float, relay: socket.socket | None = None) -> None:
        self._config = config
        self._leave = leave
        self._descriptors = [new_memory(), new_memory()]
        self.orders = SharedValue(self._descriptors[0], Order)
        self.states = SharedValue(self._descriptors[1], DogState)
        self._relay = relay
        self._process: asyncio.subprocess.Process | None = None

    @property
    def pid(self) -> int:
        """Process id."""
        assert self._process is not None
        return self._process.pid

    async def __aenter__(self) -> Self:
        """Start it and return once the drives are configured; raises LinkLost or LinkRefused."""
        try:
            await self._start()
            async with asyncio.timeout(_START):
                await self._ready()
        except TimeoutError:
            await self._close()
            raise LinkLost(f"the body controller was not ready within {_START:g} s") from None
        except BaseException:
            await self._close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Dismiss the process, which sits the robot down; kill it if that takes too long."""
        await self._close()

    async def ended(self) -> None:
        """Wait until the process ends, then raise LinkLost or LinkRefused with its last message."""
        raise _error(await self._message())

    async def _start(self) -> None:
        """Start the process with its plan, and with the shared memory for orders and states."""
        config = self._config
        world, faults = simulation(config.link) if config.link else ("", {})
        order, state = self._descriptors
        captures, relay = str(config.captures_folder), self._relay.fileno() if self._relay else -1
        plan = ControlTask(str(config.body_file), config.buses, world, faults, order, state, captures, relay)
        self._process = await asyncio.create_subprocess_exec(
            sys.executable,
            *("-m", "fleet_quadruped.control", msgspec.json.encode(plan).decode()),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            pass_fds=[*self._descriptors, relay] if self._relay else self._descriptors,
            start_new_session=True,  # Ctrl-C at the terminal is for the edge: the dog sits down first
        )

    async def _ready(self) -> None:
        """Wait for the first message; raises LinkLost or LinkRefused if it is not that it is ready."""
        message = await self._message()
        if not message.ready:
            raise _error(message)

    async def _message(self) -> StatusMessage:
        """Return the next message; the exit status if the process ended without one."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        line = await process.stdout.readline()
        if line:
            return decode_json(line, StatusMessage)
        return StatusMessage(lost=f"the body controller ended with status {await process.wait()}")

    async def _close(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            assert process.stdin is not None
            if not process.stdin.is_closing():  # else the process has died already
                process.stdin.write(DISMISSED)
            process.stdin.close()
        try:
            if process is not None:
                await _left(process, self._leave)
        finally:
            for descriptor in self._descriptors:
                os.close(descriptor)
            self._descriptors = []


async def _left(process: asyncio.subprocess.Process, within: float) -> None:
    """Wait until the process has ended; kill it after ``within`` s.

    Cancellation does not shorten the wait: a robot whose controller is killed while it sits down falls. It is
    passed on afterwards.
    """
    loop = asyncio.get_running_loop()
    until = loop.time() + within
    cancelled: asyncio.CancelledError | None = None
    while process.returncode is None and loop.time() < until:
        try:
            async with asyncio.timeout_at(until):
                await process.wait()
        except TimeoutError:
            break
        except asyncio.CancelledError as error:
            cancelled = error
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()
    if cancelled is not None:
        raise cancelled


def _error(message: StatusMessage) -> LinkLost | LinkRefused:
    if message.refused:
        return LinkRefused(message.refused)
    return LinkLost(message.lost or "the body controller ended")
