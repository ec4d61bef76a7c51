"""Queue of a vehicle's messages of some types, for the duration of an exchange with it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Generic, TypeVar

from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.statustext import Sentence

SaidT = TypeVar("SaidT", bound=MavlinkMessage | Sentence)
_MOST = 4096  # messages kept; further ones are dropped


class ReceivedMessages(Generic[SaidT]):
    """Messages in order of arrival; each is taken once."""

    def __init__(self, kinds: tuple[type[SaidT], ...]) -> None:
        self._kinds = kinds
        self._said: asyncio.Queue[SaidT] = asyncio.Queue()

    def put(self, said: MavlinkMessage | Sentence) -> None:
        """Keep a message of the wanted types; ignore any other."""
        if isinstance(said, self._kinds) and self._said.qsize() < _MOST:
            self._said.put_nowait(said)

    async def next(self, seconds: float) -> SaidT | None:
        """Return the next message, None if none arrives in time."""
        if not self._said.empty():
            return self._said.get_nowait()
        try:
            async with asyncio.timeout(seconds):
                return await self._said.get()
        except TimeoutError:
            return None

    async def first(self, wanted: Callable[[SaidT], bool], seconds: float) -> SaidT | None:
        """Return the next wanted message, None if none arrives in time."""
        by = asyncio.get_running_loop().time() + seconds
        while (left := by - asyncio.get_running_loop().time()) > 0:
            said = await self.next(left)
            if said is not None and wanted(said):
                return said
        return None
