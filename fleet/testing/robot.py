"""Implementations of Robot for tests: they record the calls of an adapter and control its time."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Any, ParamSpec, TypeVar

from fleet.adapter import Adapter
from fleet.host.robot.adapter_factory import AdapterClass, create_adapter
from fleet.host.runtime.blocking_calls import BlockingCalls
from fleet.link.base import Address, Link
from fleet.model.health import Health, Level
from fleet.model.report import Report
from fleet.robot_config import AdapterConfig, Limits
from fleet.testing.clock import LoopClock, ManualClock

OpenT = TypeVar("OpenT")
ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")
ReportT = TypeVar("ReportT", bound=Report)
WITHIN = 60.0  # s; default timeout of a wait, for slow computers


async def serve(adapter: Adapter[Any]) -> None:
    """Connect and run an adapter as the host does, until it ends or raises; to be run as a task."""
    robot = adapter.robot
    assert isinstance(robot, _CallRecorder)
    async with robot.attempt():
        await adapter.connect()
        robot.connected(answers=adapter.connects())
        await adapter.run()


@contextlib.asynccontextmanager
async def running(
    adapter: AdapterClass, config: AdapterConfig, within: float = WITHIN
) -> AsyncIterator[tuple[Adapter[Any], LoopRobot]]:
    """Run an adapter in real time for the time of a block, which begins when the robot is online.

    Yields the adapter and its robot. Raises the exception that ends the adapter, or TimeoutError.
    """
    robot = LoopRobot(config.name, adapter.limits)
    made = create_adapter(adapter, config, robot)
    serving = asyncio.create_task(serve(made))
    answered = asyncio.create_task(
        robot.until(lambda: bool(robot.healths) and robot.healths[-1].level is Level.OK, within)
    )
    try:
        await asyncio.wait({serving, answered}, return_when=asyncio.FIRST_COMPLETED)
        for task in (serving, answered):
            if task.done():
                task.result()
        yield made, robot
    finally:
        robot.close()
        for task in (serving, answered):
            task.cancel()
        await asyncio.gather(serving, answered, return_exceptions=True)


class _CallRecorder:
    """Records the calls of an adapter: ``reports``, ``healths``, ``losses``, ``left_halts``, oldest first.

    - ``lacking``: parts of the adapter's vocabulary that the robot does not support, with the reasons.
    - ``limits``: the effective limits; ``state`` survives attempts.
    - ``is_connected``: ``connect`` of the adapter has returned.
    - ``emergency_stop``: set by a test.
    """

    def __init__(self, name: str, limits: Limits) -> None:
        self.name = name
        self.limits = limits
        self.state: dict[str, Any] = {}
        self.is_connected = False
        self.emergency_stop = False
        self._contexts = contextlib.AsyncExitStack()
        self._blocking = BlockingCalls(name)
        self.log = logging.getLogger(f"fleet.robot.{name}")
        self.reports: list[Report] = []
        self.healths: list[Health] = []
        self.losses: list[str] = []
        self.left_halts: list[tuple[bytes, ...]] = []
        self.circle = 0.0
        self.lacking: dict[str, str] = {}
        self._changed = asyncio.Event()

    def report(self, report: Report) -> None:
        """Record a report; the first one marks the robot as ok, as in the host."""
        self.reports.append(report)
        self._answers(answers=True)
        self._changed.set()

    @contextlib.asynccontextmanager
    async def attempt(self) -> AsyncIterator[None]:
        """Run an attempt; exit the contexts of the adapter at its end."""
        self.is_connected = False
        async with self._contexts:
            yield

    def connected(self, *, answers: bool) -> None:
        """Record that ``connect`` has returned; ``answers``: its return means that the robot answers."""
        self.is_connected = True
        self._answers(answers=answers or bool(self.reports))
        self._changed.set()

    def _answers(self, *, answers: bool) -> None:
        """Set the health to ok, as the host does, unless the adapter has set it."""
        if answers and self.is_connected and not self.healths:
            self.health(Health())

    async def enter(self, context: AbstractAsyncContextManager[OpenT]) -> OpenT:
        """Enter a context until the attempt ends."""
        return await self._contexts.enter_async_context(context)

    async def blocking(
        self, call: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs
    ) -> ResultT:
        """Make a blocking call on a thread of its own."""
        return await self._blocking.call(call, *args, **kwargs)

    def reports_of(self, kind: type[ReportT]) -> list[ReportT]:
        """Return the reports of a kind, oldest first."""
        return [report for report in self.reports if isinstance(report, kind)]

    def health(self, health: Health) -> None:
        """Record the health of the robot."""
        self.healths.append(health)
        self._changed.set()

    def authority_lost(self, reason: str) -> None:
        """Record that a pilot or another station took control."""
        self.losses.append(reason)
        self._changed.set()

    def lacks(self, reasons: Mapping[str, str]) -> None:
        """Record the parts of the vocabulary that the robot does not support."""
        self.lacking = dict(reasons)

    def circles(self, radius: float) -> None:
        """Record the radius of the robot's circle in m."""
        self.circle = radius

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:  # noqa: ARG002 - no supervisor opens it here
        """Record the frames that would halt the robot after the death of its process."""
        self.left_halts.append(tuple(frames))

    def share(
        self,
        key: str,  # noqa: ARG002 - a single robot shares nothing
        make: Callable[[], AbstractAsyncContextManager[OpenT]],
    ) -> AbstractAsyncContextManager[OpenT]:
        """Return the context of ``make``."""
        return make()

    async def until(self, condition: Callable[[], bool], within: float = WITHIN) -> None:
        """Wait until a condition on the records holds; raises TimeoutError."""
        async with asyncio.timeout(within):
            while not condition():
                self._changed.clear()
                await self._changed.wait()

    async def first(self, kind: type[ReportT]) -> ReportT:
        """Wait for the first report of a kind; raises TimeoutError."""
        await self.until(lambda: bool(self.reports_of(kind)))
        return self.reports_of(kind)[0]


class RecordingRobot(_CallRecorder):
    """The robot of an adapter in a test that advances the time itself."""

    def __init__(
        self, name: str = "robot", clock: ManualClock | None = None, limits: Limits | None = None
    ) -> None:
        super().__init__(name, limits or Limits())
        self.clock = clock or ManualClock()
        self._calls: list[_Periodic] = []

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Schedule a periodic call, made by ``advance``."""
        self._calls.append(_Periodic(seconds, call, self.clock.monotonic() + seconds))

    def advance(self, seconds: float) -> None:
        """Let time pass and make the calls that are due, in order.

        Raises the exception of a call; the host would end the ``run``.
        """
        end = self.clock.monotonic() + seconds
        while self._calls:
            first = min(self._calls, key=lambda call: call.due)
            if first.due > end:
                break
            self.clock.advance(max(0.0, first.due - self.clock.monotonic()))
            first.due += first.period
            first.call()
        self.clock.advance(max(0.0, end - self.clock.monotonic()))


class LoopRobot(_CallRecorder):
    """A recording robot in the time of the running event loop, which makes the calls until ``close``.

    In a loop with simulated time everything runs as fast as possible. ``failure``: the exception of a
    periodic call, which ended all of them; the host would end the ``run``.
    """

    def __init__(self, name: str = "robot", limits: Limits | None = None) -> None:
        super().__init__(name, limits or Limits())
        self.clock = LoopClock(asyncio.get_running_loop())
        self.failure: Exception | None = None
        self._timers: dict[Callable[[], None], asyncio.TimerHandle] = {}

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Schedule a periodic call."""
        loop = asyncio.get_running_loop()

        def again() -> None:
            self._timers[call] = loop.call_later(seconds, again)
            try:
                call()
            except Exception as error:
                self.log.exception("a periodic call failed")
                self.failure = error
                self.close()

        self._timers[call] = loop.call_later(seconds, again)

    def close(self) -> None:
        """Cancel all periodic calls."""
        for timer in self._timers.values():
            timer.cancel()


class _Periodic:
    """One periodic call, with the time when it is due (monotonic s)."""

    def __init__(self, period: float, call: Callable[[], None], due: float) -> None:
        self.period = period
        self.call = call
        self.due = due
