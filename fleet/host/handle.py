"""What the host gives an adapter for one run: reports go out, health comes in, timers hang on the wheel."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from contextlib import AbstractAsyncContextManager
from typing import TypeVar

from fleet.clock import Clock
from fleet.host.shared import Shared
from fleet.host.wheel import Spoke, Wheel
from fleet.link.base import Address, Link
from fleet.model.health import Health
from fleet.model.report import Report
from fleet.supervisor.client import Supervised

SharedT = TypeVar("SharedT")


class Handle:
    """The ``Robot`` of one run. After ``close`` it does nothing more, whoever still holds it."""

    def __init__(
        self,
        name: str,
        *,
        clock: Clock,
        wheel: Wheel,
        shared: Shared,
        publish: Callable[[Report], None],
        healthy: Callable[[Health], None],
        lost_authority: Callable[[str], None],
        failed: Callable[[Exception], None],
        supervised: Supervised,
    ) -> None:
        self.name = name
        self.has_left_halt = False
        self._supervised = supervised
        self.clock = clock
        self.log = logging.getLogger(f"fleet.robot.{name}")
        self._wheel = wheel
        self._shared = shared
        self._publish = publish
        self._healthy = healthy
        self._lost_authority = lost_authority
        self._failed = failed
        self._spokes: list[Spoke] = []
        self._closed = False

    def report(self, report: Report) -> None:
        """Publish something learned."""
        if not self._closed:
            self._publish(report)

    def health(self, health: Health) -> None:
        """Say how the way to the robot is."""
        if not self._closed:
            self._healthy(health)

    def authority_lost(self, reason: str) -> None:
        """Say that somebody else took the robot."""
        if not self._closed:
            self._lost_authority(reason)

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:
        """Leave what halts the robot with the supervisor."""
        if not self._closed:
            self.has_left_halt = self._supervised.keep(self.name, link.fileno(), frames, address)

    async def take_halt_back(self) -> None:
        """Have the supervisor let go of the robot's link, so that it can be opened again; bounded in time."""
        if self.has_left_halt:
            self.has_left_halt = False
            await self._supervised.drop(self.name)

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Call back about every ``seconds`` until the run ends."""
        if not self._closed:
            self._spokes.append(self._wheel.every(seconds, call, owner=self.name, failed=self._failed))

    def share(
        self, key: str, make: Callable[[], AbstractAsyncContextManager[SharedT]]
    ) -> AbstractAsyncContextManager[SharedT]:
        """Enter what all robots with the same key use together."""
        return self._shared.share(key, make)

    def close(self) -> None:
        """End the run's timers and reports."""
        self._closed = True
        for spoke in self._spokes:
            spoke.cancel()
