"""A Robot for tests: it records what an adapter tells the host, and the test makes its time pass."""

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
WITHIN = 60.0  # s; how long a test waits for what must happen, on a slow computer


async def serve(adapter: Adapter[Any]) -> None:
    """Connect and run an adapter as the host does, until it ends or raises; a test's task for it."""
    robot = adapter.robot
    assert isinstance(robot, _Robot)
    async with robot.attempt():
        await adapter.connect()
        robot.connected(answers=adapter.connects())
        await adapter.run()


@contextlib.asynccontextmanager
async def running(
    adapter: AdapterClass, config: AdapterConfig, within: float = WITHIN
) -> AsyncIterator[tuple[Adapter[Any], LoopRobot]]:
    """Run an adapter in real time for a block, which begins when its robot answers.

    Yields the adapter as the host has it, and its robot. Raises what ends the adapter, and TimeoutError.
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


class _Robot:
    """What both robots below record: ``reports``, ``healths``, ``losses``, ``left_halts``, oldest first.

    ``lacking``: what of its adapter's vocabulary the robot does not have, with the reason.
    ``limits``: those that are said to be in force; ``state`` outlives attempts. ``is_connected``: ``connect``
    of its adapter has returned. ``emergency_stop``: one is set, as a test wants.
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
        self._told = asyncio.Event()

    def report(self, report: Report) -> None:
        """Record a report; the first means ok, as it does to the host."""
        self.reports.append(report)
        self._answers(answers=True)
        self._told.set()

    @contextlib.asynccontextmanager
    async def attempt(self) -> AsyncIterator[None]:
        """Leave at the end what an adapter has entered."""
        self.is_connected = False
        async with self._contexts:
            yield

    def connected(self, *, answers: bool) -> None:
        """Note that ``connect`` has returned; ``answers``: that means that the robot is there."""
        self.is_connected = True
        self._answers(answers=answers or bool(self.reports))
        self._told.set()

    def _answers(self, *, answers: bool) -> None:
        """Say that all is well where the adapter has said nothing of it, as the host does."""
        if answers and self.is_connected and not self.healths:
            self.health(Health())

    async def enter(self, context: AbstractAsyncContextManager[OpenT]) -> OpenT:
        """Enter a context until the attempt ends."""
        return await self._contexts.enter_async_context(context)

    async def blocking(
        self, call: Callable[ParamsT, ResultT], *args: ParamsT.args, **kwargs: ParamsT.kwargs
    ) -> ResultT:
        """Make a call that blocks on a thread of its own."""
        return await self._blocking.call(call, *args, **kwargs)

    def reports_of(self, kind: type[ReportT]) -> list[ReportT]:
        """Return the reports of a kind, oldest first."""
        return [report for report in self.reports if isinstance(report, kind)]

    def health(self, health: Health) -> None:
        """Record how the way to the robot is."""
        self.healths.append(health)
        self._told.set()

    def authority_lost(self, reason: str) -> None:
        """Record that somebody else took the robot."""
        self.losses.append(reason)
        self._told.set()

    def lacks(self, reasons: Mapping[str, str]) -> None:
        """Record what of the declared vocabulary the robot does not have."""
        self.lacking = dict(reasons)

    def circles(self, radius: float) -> None:
        """Record how wide the robot circles where it ends, m."""
        self.circle = radius

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:  # noqa: ARG002 - nobody else opens it here
        """Record what would halt the robot after the death of its process."""
        self.left_halts.append(tuple(frames))

    def share(
        self,
        key: str,  # noqa: ARG002 - a lone robot shares with nobody
        make: Callable[[], AbstractAsyncContextManager[OpenT]],
    ) -> AbstractAsyncContextManager[OpenT]:
        """Return what ``make`` gives."""
        return make()

    async def until(self, condition: Callable[[], bool], within: float = WITHIN) -> None:
        """Wait until a condition on what was recorded holds; raises TimeoutError."""
        async with asyncio.timeout(within):
            while not condition():
                self._told.clear()
                await self._told.wait()

    async def first(self, kind: type[ReportT]) -> ReportT:
        """Wait for the first report of a kind; raises TimeoutError."""
        await self.until(lambda: bool(self.reports_of(kind)))
        return self.reports_of(kind)[0]


class RecordingRobot(_Robot):
    """What an adapter's ``run`` is given in a test that advances the time itself.

    ``reports``, ``healths`` and ``losses`` are what it was told, oldest first.
    """

    def __init__(
        self, name: str = "robot", clock: ManualClock | None = None, limits: Limits | None = None
    ) -> None:
        super().__init__(name, limits or Limits())
        self.clock = clock or ManualClock()
        self._calls: list[_Periodic] = []

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Hang a call on the wheel, which ``advance`` turns."""
        self._calls.append(_Periodic(seconds, call, self.clock.monotonic() + seconds))

    def advance(self, seconds: float) -> None:
        """Turn the wheel: let time pass and make the calls that are due, in their order.

        What a call raises is raised here; the host would end the ``run``.
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


class LoopRobot(_Robot):
    """The same, in the time of the running event loop, which makes the calls; ``close`` ends them.

    The loop's time may be a test's own: then everything goes as fast as it can.
    """

    def __init__(self, name: str = "robot", limits: Limits | None = None) -> None:
        super().__init__(name, limits or Limits())
        self.clock = LoopClock(asyncio.get_running_loop())
        self._timers: dict[Callable[[], None], asyncio.TimerHandle] = {}

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Make a call again and again."""
        loop = asyncio.get_running_loop()

        def again() -> None:
            self._timers[call] = loop.call_later(seconds, again)
            call()

        self._timers[call] = loop.call_later(seconds, again)

    def close(self) -> None:
        """Make no more calls."""
        for timer in self._timers.values():
            timer.cancel()


class _Periodic:
    """One call on the wheel and when it is due (monotonic s)."""

    def __init__(self, period: float, call: Callable[[], None], due: float) -> None:
        self.period = period
        self.call = call
        self.due = due
