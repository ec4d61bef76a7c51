"""Somebody at the controls of an adapter under test, without a host between them."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from fleet.adapter import Adapter
from fleet.host.robot.adapter_factory import start_command
from fleet.model.command import Command
from fleet.model.geometry import Velocity

PERIOD = 0.1  # s between the velocities that an operator's stick sends


class Operator:
    """Carries out commands and drives; a base for a test's own robot, which sets ``adapter``."""

    adapter: Adapter[Any]

    async def do(self, name: str, /, **data: object) -> object:
        """Carry out a command; return its answer, or its progress in percent.

        Raises what the command raises, and TimeoutError after the time that it declares.
        """
        spec = self.adapter.commands()[name]
        doing = start_command(self.adapter, spec, Command(name, data))
        async with asyncio.timeout(spec.timeout):
            if not spec.streams:
                return await doing
            async with contextlib.aclosing(doing):
                return [progress.percent async for progress in doing]

    async def drive(self, velocity: Velocity, seconds: float) -> None:
        """Ask for a velocity at 10 Hz; raises what ``Adapter.drive`` raises."""
        for _ in range(round(seconds / PERIOD)):
            self.adapter.drive(velocity)
            await asyncio.sleep(PERIOD)
