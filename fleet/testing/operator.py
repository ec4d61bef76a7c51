"""Commands and velocities for an adapter under test, without the safety rules of the host."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from fleet.adapter import Adapter
from fleet.host.robot.adapter_factory import capabilities, start_command
from fleet.host.robot.frame_adapter_runner import FrameAdapterRunner
from fleet.model.command import Command
from fleet.model.geometry import Velocity

PERIOD = 0.1  # s between the velocities of an operator's stick


class Operator:
    """Executes commands of a connected adapter and drives it; ``adapter`` is the one that ``running`` yields.

    It is also a base class for a robot in a test, which may set ``adapter`` later.
    """

    def __init__(self, adapter: Adapter[Any]) -> None:
        self.adapter = adapter

    async def do(self, name: str, /, **data: object) -> object:
        """Execute a command; return its answer, or its progress values in percent.

        Raises the exception of the command, TimeoutError after its declared timeout, and LookupError for a
        command that the adapter does not declare.
        """
        # The runner of a FrameAdapter declares no commands itself.
        declared = self.adapter.inner if isinstance(self.adapter, FrameAdapterRunner) else self.adapter
        commands = capabilities(type(declared)).commands
        if name not in commands:
            raise LookupError(f"no command {name!r}; declared: {', '.join(sorted(commands)) or 'none'}")
        spec = commands[name]
        doing = start_command(self.adapter, spec, Command(name, data))
        async with asyncio.timeout(spec.timeout):
            if not spec.streams:
                return await doing
            async with contextlib.aclosing(doing):
                return [progress.percent async for progress in doing]

    async def drive(self, velocity: Velocity, seconds: float) -> None:
        """Repeat a velocity at 10 Hz for some seconds; raises the exception of ``Adapter.drive``."""
        for _ in range(round(seconds / PERIOD)):
            self.adapter.drive(velocity)
            await asyncio.sleep(PERIOD)
