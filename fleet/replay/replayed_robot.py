"""The host's side of a robot in a replay: it runs in the time of the recording, and records reports."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Any, ParamSpec, TypeVar

from fleet.errors import Unsupported, WireError
from fleet.link.base import Address, Link
from fleet.model.health import Health
from fleet.model.report import Report
from fleet.record.messages import report_messages
from fleet.replay.recorded_robot import RecordedReport, RecordedRobot, said_in
from fleet.robot_config import Limits
from fleet.wire.checks import check_report
from fleet.wire.databus import encode_report

OpenT = TypeVar("OpenT")
ResultT = TypeVar("ResultT")
ParamsT = ParamSpec("ParamsT")
RecordedChannels = Mapping[int, frozenset[str]]
"""The channels on which each periodic call reports, by the number of the call in order of registration."""


class RecordedTime:
    """A fleet.clock.Clock that advances with its event loop, and starts at ``begins`` (Unix s)."""

    def __init__(self, begins: float) -> None:
        self._loop = asyncio.get_running_loop()
        self._offset = begins - self._loop.time()

    def monotonic(self) -> float:
        """Return monotonic seconds."""
        return self._loop.time()

    def time(self) -> float:
        """Return Unix seconds."""
        return self._loop.time() + self._offset


class _RecordedCall:
    """One periodic call of an adapter: its number, and its timer while it runs by its period."""

    def __init__(self, number: int, period: float, call: Callable[[], None]) -> None:
        self.number = number
        self.period = period
        self.call = call
        self.timer: asyncio.TimerHandle | None = None


class ReplayedRobot:
    """One robot. ``said`` are its reports by channel; ``channels``: which periodic call reported on which.

    The ticks of the host were not recorded, but the reports made in them were. So a periodic call that
    reports, as ``known`` from an earlier replay, is made at the recorded times of its reports; every other
    runs by its period. Without ``known``, every call is made at every recorded time, to learn the channels.
    """

    def __init__(
        self,
        recorded: RecordedRobot,
        limits: Limits,
        clock: RecordedTime,
        state: dict[str, Any],
        known: RecordedChannels | None,
    ) -> None:
        self.name = name = recorded.name
        self._prefix = f"/{recorded.edge}/{name}"
        self.limits = limits
        self.clock = clock
        self.state = state
        self.log = logging.getLogger(f"fleet.replay.{name}")
        self.emergency_stop = False
        self.log.propagate = False  # its log messages about the past are no news
        self.said: dict[str, list[RecordedReport]] = {}
        self.channels: dict[int, frozenset[str]] = {}
        self.failed: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._known = known
        self._periodics: list[_RecordedCall] = []
        self._calling: int | None = None
        self._contexts = contextlib.AsyncExitStack()

    async def close(self) -> None:
        """Exit the entered contexts, and cancel the periodic calls."""
        for periodic in self._periodics:
            if periodic.timer is not None:
                periodic.timer.cancel()
        self._periodics = []
        self.failed.cancel()
        await self._contexts.aclose()

    def at(self, channel: str) -> None:
        """Make the calls that report on a channel, at the time of a recorded report."""
        for periodic in tuple(self._periodics):
            if self._known is None or channel in self._known.get(periodic.number, ()):
                self._call(periodic)

    def report(self, report: Report) -> None:
        """Store a report in its recorded form; invalid reports are skipped."""
        try:
            check_report(report)
            sample = encode_report(report, 0)
        except WireError:
            return
        sensor = getattr(report, "sensor", "") or None
        message = report_messages(self._prefix, report.channel, sample, sensor=sensor)[0]
        topic = message.topic.removeprefix(f"{self._prefix}/")
        channel, said = said_in(topic, message.payload, report.stamp)
        self.said.setdefault(channel, []).append(said)
        if self._calling is not None:
            self.channels[self._calling] = self.channels.get(self._calling, frozenset()) | {channel}

    def health(self, health: Health) -> None:
        """Ignore the health; it is no report."""

    def authority_lost(self, reason: str) -> None:
        """Ignore the loss of authority; it is no report."""

    def lacks(self, reasons: Mapping[str, str]) -> None:
        """Ignore missing vocabulary; no requests are made."""

    def circles(self, radius: float) -> None:
        """Ignore the circle's radius; there is no separation."""

    def leave_halt(self, link: Link, frames: Iterable[bytes], address: Address = None) -> None:
        """Ignore the halt frames; there is no supervisor."""

    def every(self, seconds: float, call: Callable[[], None]) -> None:
        """Make a call at the recorded times of its reports, or else by its period."""
        periodic = _RecordedCall(len(self._periodics), seconds, call)
        self._periodics.append(periodic)
        if self._known is None or not self._known.get(periodic.number):
            self._again(periodic)

    async def enter(self, context: AbstractAsyncContextManager[OpenT]) -> OpenT:
        """Enter a context until the attempt ends."""
        return await self._contexts.enter_async_context(context)

    def share(
        self,
        key: str,  # noqa: ARG002 - a robot is replayed alone
        make: Callable[[], AbstractAsyncContextManager[OpenT]],
    ) -> AbstractAsyncContextManager[OpenT]:
        """Return the context of ``make``."""
        return make()

    async def blocking(
        self,
        call: Callable[ParamsT, ResultT],  # noqa: ARG002 - nothing is called
        *args: ParamsT.args,  # noqa: ARG002
        **kwargs: ParamsT.kwargs,  # noqa: ARG002
    ) -> ResultT:
        """Raise Unsupported: a call that depends on the outside could not be replayed."""
        raise Unsupported("a replay makes no blocking calls")

    def _again(self, periodic: _RecordedCall) -> None:
        """Schedule the next call of a periodic call."""

        def turn() -> None:
            self._again(periodic)
            self._call(periodic)

        periodic.timer = asyncio.get_running_loop().call_later(periodic.period, turn)

    def _call(self, periodic: _RecordedCall) -> None:
        """Make a call; an exception ends the attempt."""
        self._calling = periodic.number
        try:
            periodic.call()
        except Exception as error:  # noqa: BLE001 - passed to the task that waits for the attempt
            if not self.failed.done():
                self.failed.set_exception(error)
        finally:
            self._calling = None
