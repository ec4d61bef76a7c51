"""Runs discrete commands on an adapter: one moving command at a time, each answered exactly once."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine
from typing import Any

from fleet.adapter import Adapter
from fleet.commands import CommandSpec
from fleet.errors import CommandError, LinkError, TimedOut
from fleet.host.make import perform
from fleet.host.ticket import Ticket
from fleet.model.command import Command

log = logging.getLogger(__name__)

AT_ONCE = 8  # commands that do not move, under way together; more are refused


class Executor:
    """The running commands of one robot."""

    def __init__(self, *, crashed: Callable[[Exception], None]) -> None:
        self._crashed = crashed
        self._tasks: set[asyncio.Task[None]] = set()
        self._mover: asyncio.Task[None] | None = None
        self._why = ""
        self.moving = ""

    def start(self, adapter: Adapter[Any], spec: CommandSpec, ask: Command, ticket: Ticket) -> None:
        """Run a command; a moving one takes the place of the moving one before it."""
        if spec.moves:
            self.cancel(f"superseded by {ask.name}")
        elif len(self._tasks) >= AT_ONCE:
            ticket.reject(f"{AT_ONCE} commands are under way; try again")
            return
        task = self.spawn(self._run(adapter, spec, ask, ticket), name=ask.name)
        if spec.moves:
            self._mover, self.moving = task, ask.name
            task.add_done_callback(self._moved)

    def cancel(self, why: str) -> None:
        """End the moving command; its ticket is told why."""
        if self._mover is not None:
            self._why = why
            self._mover.cancel(why)
            self._mover, self.moving = None, ""

    def spawn(self, work: Coroutine[Any, Any, None], *, name: str) -> asyncio.Task[None]:
        """Run something of this robot's, kept alive until it ends."""
        task = asyncio.create_task(work, name=f"command:{name}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _moved(self, task: asyncio.Task[None]) -> None:
        """Note that the moving command has ended."""
        if self._mover is task:
            self._mover, self.moving = None, ""

    async def _run(self, adapter: Adapter[Any], spec: CommandSpec, ask: Command, ticket: Ticket) -> None:
        """Run one command to its end and answer."""
        try:
            async with asyncio.timeout(spec.timeout):
                await self._call(adapter, spec, ask, ticket)
            ticket.done()
        except TimeoutError:
            ticket.fail(TimedOut(f"{ask.name} was not seen done within {spec.timeout:g} s"))
        except (CommandError, LinkError) as error:
            ticket.fail(error)
        except asyncio.CancelledError as cancelled:
            ticket.reject(str(cancelled) or self._why)
            raise
        except Exception as error:
            log.exception("the adapter failed in %s", ask.name)
            ticket.reject(f"the adapter failed: {type(error).__name__}: {error}")
            self._crashed(error)

    async def _call(self, adapter: Adapter[Any], spec: CommandSpec, ask: Command, ticket: Ticket) -> None:
        """Call the adapter's method; its first progress is the receipt."""
        call = perform(adapter, spec, ask)
        if not spec.streams:
            await call
            return
        async for _ in call:
            ticket.accept()
