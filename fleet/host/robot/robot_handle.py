"""Host side of one attempt to run a robot: reports, health, timers, contexts, blocking calls."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from functools import partial
from typing import Any, ParamSpec, TypeVar

from fleet.clock import Clock
from fleet.host.runtime.blocking_calls import BlockingCalls
from fleet.host.runtime.shared_resources import SharedResources
from fleet.host.runtime.tick_scheduler import PeriodicCall, TickScheduler
from fleet.link.base import Address, Link
from fleet.model.health import Health
from fleet.model.report import Report
from fleet.robot_config import Limits
from fleet.supervisor.client import SupervisorClient

KEPT_WITHIN = 2.0  # s for the supervisor to confirm that it keeps a halt
POLL_INTERVAL = 0.5  # s between checks of that

OpenT = TypeVar("OpenT")
ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")


class RobotHandle:
    """The ``Robot`` of one attempt. After ``close`` its methods have no effect.

    ``contexts`` are the contexts that the attempt has entered; the runner exits them. ``state`` and ``calls``
    outlive the attempt.
    """

    def __init__(
        self,
        name: str,
        *,
        limits: Limits,
        state: dict[str, Any],
        calls: BlockingCalls,
        clock: Clock,
        scheduler: TickScheduler,
        shared: SharedResources,
        publish: Callable[[Report], None],
        healthy: Callable[[Health], None],
        lost_authority: Callable[[str], None],
        latched: Callable[[], bool],
        lacking: dict[str, str],
        circled: Callable[[float], None],
        failed: Callable[[Exception], None],
        supervised: SupervisorClient,
    ) -> None:
        self.name = name
        self.limits = limits
        self.state = state
        self.contexts = AsyncExitStack()
        self._calls = calls
        self._connected = self._reported = False
        self._supervised = supervised
        self._sent = self._kept = 0  # halts sent to the supervisor; number of the one that it confirmed
        self._kept_by = 0.0  # deadline of its confirmation (monotonic s)
        self._counts = True  # has_left_halt at the last health report
        self._watches = False
        self._said: Health | None = None
        self.clock = clock
        self.log = logging.getLogger(f"fleet.robot.{name}")
        self._scheduler = scheduler
        self._shared = shared
        self._publish = publish
        self._healthy = healthy
        self._lost_authority = lost_authority
        self._latched = latched
        self._lacking = lacking
        self._circled = circled
        self._failed = failed
        self._periodics: list[PeriodicCall] = []
        self._closed = False

    @property
    def emergency_stop(self) -> bool:
        """True while an emergency stop is set."""
        return self._latched()

    def report(self, report: Report) -> None:
        """Publish a report; the first one shows that the robot answers, unless its adapter reports health."""
        if self._closed:
            return
        self._publish(report)
        self._reported = True
        if self._said is None and self._connected:
            self.health(Health())

    def health(self, health: Health) -> None:
        """Set the health; passed on once the adapter has connected and accepts stops."""
        if not self._closed:
            self._said, self._counts = health, self.has_left_halt
            if self._connected:
                self._healthy(health)

    def connected(self, *, answers: bool) -> None:
        """Record that the adapter accepts requests; ``answers``: connecting proved the robot's presence."""
        self._connected = True
        health = self._said or (Health() if answers or self._reported else None)
        if health is not None:
            self.health(health)

    def authority_lost(self, reason: str) -> None:
        """Report that another party took control of the robot."""
        if not self._closed:
            self._lost_authority(reason)

    def lacks(self, reasons: Mapping[str, str]) -> None:
        """Set the declared capabilities that the robot does not have; an empty reason gets a text."""
        if not self._closed:
            self._lacking.clear()
            self._lacking.update(
                {name: why or "this robot does not have it" for name, why in reasons.items()}
            )

    def circles(self, radius: float) -> None:
        """Set the radius in metres at which the robot circles at the end of a task; 0: it stands."""
        if not math.isfinite(radius) or radius < 0.0:
            raise ValueError(f"{radius} m is no radius of a circle")
        if not self._closed:
            self._circled(radius)

    @property
    def has_left_halt(self) -> bool:
        """True while the supervisor keeps the robot's halt, or may still confirm it in time."""
        return bool(self._sent) and (self._kept == self._sent or self.clock.monotonic() <= self._kept_by)

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:
        """Register the halt with the supervisor; its confirmation is not waited for."""
        if self._closed:
            return
        self._sent += 1
        kept = partial(self._keeps, self._sent)
        if self._supervised.register(self.name, link.fileno(), frames, address, kept=kept):
            self._kept_by = self.clock.monotonic() + KEPT_WITHIN
            self._watch_halt()
        else:
            self._kept_by = -math.inf

    def _keeps(self, number: int) -> None:
        """Record the confirmation of this halt; on the supervisor client's thread."""
        self._kept = number

    def _watch_halt(self) -> None:
        """Start the periodic check whether the halt is confirmed."""
        if not self._watches:
            self._watches = True
            self.every(POLL_INTERVAL, self._look_at_halt)

    def _look_at_halt(self) -> None:
        """Repeat the health report when the halt's confirmation has come or is overdue."""
        counts = self.has_left_halt
        if counts == self._counts or self._said is None:
            return
        if not counts:
            self.log.error("the supervisor did not keep its halt within %g s", KEPT_WITHIN)
        self.health(self._said)

    async def withdraw_halt(self) -> None:
        """Make the supervisor release the robot's link, so that it can be reopened; bounded in time."""
        if self._sent:
            self._sent = self._kept = 0
            await self._supervised.drop(self.name)

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Call ``call`` about every ``seconds`` until the attempt ends."""
        if not self._closed:
            self._periodics.append(self._scheduler.every(seconds, call, owner=self.name, failed=self._failed))

    async def enter(self, context: AbstractAsyncContextManager[OpenT]) -> OpenT:
        """Enter a context until the attempt ends."""
        return await self.contexts.enter_async_context(context)

    def share(
        self, key: str, make: Callable[[], AbstractAsyncContextManager[OpenT]]
    ) -> AbstractAsyncContextManager[OpenT]:
        """Return the resource that all robots with this key share."""
        return self._shared.share(key, make)

    async def blocking(
        self, call: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs
    ) -> ResultT:
        """Make a blocking call on its own thread."""
        return await self._calls.call(call, *args, **kwargs)

    def close(self) -> None:
        """End the attempt's timers and reports."""
        self._closed = True
        for periodic in self._periodics:
            periodic.cancel()
