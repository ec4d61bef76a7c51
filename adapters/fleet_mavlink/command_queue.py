"""Turns of the commands to one vehicle: one at a time, and the conditions that end pending ones."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Container
from typing import Self

from fleet import Refused
from fleet_mavlink.messages import CommandAck, MavlinkCommand
from fleet_mavlink.motion_effect import Effect


class Superseded(Refused):
    """A command ended because something more urgent took over."""


class CommandExchange:
    """The turn of one command, entered once it is the current one, with its acknowledgements.

    ``yields``: a request of the adapter itself, which gives its turn to any other command.
    """

    def __init__(
        self,
        turns: CommandQueue,
        request: MavlinkCommand,
        *,
        effect: Effect = Effect.NONE,
        yields: bool = False,
    ) -> None:
        self.yields = yields
        self.command = request.command
        self.effect = effect
        self.began = 0.0
        self.acks: deque[CommandAck] = deque()
        self.refusal: CommandAck | None = None
        self.refused_at = 0.0
        self.superseded = ""
        self._wakeup: asyncio.Future[None] | None = None  # while a task waits
        self._turns = turns

    async def __aenter__(self) -> Self:
        """Wait for the turn, and listen for acknowledgements before the command is sent; raises Refused."""
        turns = self._turns
        if not self.yields:
            turns.end_yielding()
        turns.waiting.add(self)
        try:
            await turns.lock.acquire()
        finally:
            turns.waiting.discard(self)
        if self.superseded:
            turns.lock.release()
            self.require_wanted()
        turns.current = self
        self.began = turns.now()
        return self

    async def __aexit__(self, *_: object) -> None:
        """Stop listening."""
        self._turns.current = None
        self._turns.lock.release()

    def supersede(self, reason: str) -> None:
        """End the exchange with this reason."""
        self.superseded = reason
        self.wake()

    def add(self, ack: CommandAck) -> None:
        """Add an acknowledgement."""
        self.acks.append(ack)
        self.wake()

    def wake(self) -> None:
        """Wake the waiting task."""
        if self._wakeup is not None and not self._wakeup.done():
            self._wakeup.set_result(None)

    async def next(self) -> CommandAck:
        """Wait for an acknowledgement; raises Refused if something more urgent took over."""
        while not self.acks and not self.superseded:
            self._wakeup = asyncio.get_running_loop().create_future()
            await self._wakeup
        self.require_wanted()
        return self.acks.popleft()

    def require_wanted(self) -> None:
        """Raise Refused if something more urgent took over."""
        if self.superseded:
            raise Superseded(f"superseded: {self.superseded}")


class CommandQueue:
    """The current command, and the waiting ones."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.lock = asyncio.Lock()
        self.current: CommandExchange | None = None
        self.waiting: set[CommandExchange] = set()
        self.now = now
        self._halted = False  # by another thread, since ``end_halted``

    def supersede(self, reason: str) -> None:
        """End the current and the waiting commands with this reason, for a more urgent one."""
        for exchange in self._all():
            exchange.supersede(reason)

    def end_yielding(self) -> None:
        """End commands that yield: no user waits for their result."""
        for exchange in self._all():
            if exchange.yields:
                exchange.supersede("something else is asked")

    def halt(self, effects: Container[Effect]) -> None:
        """End the repetition of commands with these effects; from any thread, so nothing is woken yet."""
        for exchange in self._all():
            if exchange.effect in effects:
                exchange.superseded = "the robot was halted"
                self._halted = True

    def end_halted(self) -> bool:
        """Wake the commands halted by another thread; return whether there were any, and no motion since."""
        halted, self._halted = self._halted, False
        for exchange in self._all() if halted else ():
            if exchange.superseded:
                exchange.wake()
            elif exchange.effect is not Effect.NONE:
                halted = False
        return halted

    def _all(self) -> tuple[CommandExchange, ...]:
        """Return the current command, and the waiting ones."""
        current = self.current
        return (*tuple(self.waiting), *((current,) if current else ()))
