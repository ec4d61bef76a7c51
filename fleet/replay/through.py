"""Replay of recorded raw frames through the present adapters, in recorded time and without other I/O."""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from fleet.adapter import Adapter, AnyAdapter, FrameAdapter
from fleet.errors import LinkError, NotReady, Refused
from fleet.host.robot.adapter_factory import create_adapter
from fleet.link.tap import LinkFrame
from fleet.link.url import OPENER
from fleet.replay.differences import Difference, differences
from fleet.replay.recorded_links import RecordedLinks
from fleet.replay.recorded_robot import RecordedReport, RecordedRobot
from fleet.replay.replayed_robot import RecordedChannels, RecordedTime, ReplayedRobot
from fleet.robot_config import AdapterConfig
from fleet.runtime.simulated_time import JumpingLoop

SETTLED = 10.0
"""Seconds for an adapter to recover its state, if the recording does not begin with the opened link."""
TURNS = 50
"""Iterations of the event loop for an adapter's actions that take no time."""
_ENDS = (LinkError, NotReady)
"""Ordinary ends of an attempt to run a robot: the host creates a new adapter."""


class Replayed(msgspec.Struct, frozen=True):
    """Result of one robot: number of compared reports, from when (Unix s), and the differences."""

    robot: str
    compared: int
    since: float
    is_whole: bool
    found: tuple[Difference, ...]


def replay(plugin: type[AnyAdapter], config: AdapterConfig, recorded: RecordedRobot) -> Replayed:
    """Feed the frames of a robot to its adapter, and compare its reports with the recorded ones.

    ``config`` is as in fleet.yaml. It runs an event loop of its own, so it cannot be called inside of one.
    Raises Refused if the recording has no frames of the robot, or if its adapter cannot be replayed.
    """
    if not recorded.frames:
        raise Refused(
            f"the recording has no frames of {config.name}",
            hint="record it with this version; robots whose adapters open no links have none",
        )
    learned, _, _ = _replayed(plugin, config, recorded, None)
    _, said, failure = _replayed(plugin, config, recorded, learned)
    begins = recorded.frames[0][1].at
    since = begins if recorded.is_whole else begins + SETTLED
    compared = {name: each for name, each in recorded.reports.items() if _is_replayed(plugin, name)}
    found = list(differences(config.name, compared, said, since=since, tolerance=plugin.replay_tolerance))
    if failure is not None:
        found.append(failure)
    count = sum(each.stamp >= since for reports in compared.values() for each in reports)
    return Replayed(config.name, count, since, recorded.is_whole, tuple(found))


def _is_replayed(plugin: type[AnyAdapter], channel: str) -> bool:
    """Return True if frames alone determine an adapter's reports on a channel."""
    channels = plugin.replayed_channels
    return channels is None or channel.partition("/")[0] in channels


def _replayed(
    plugin: type[AnyAdapter], config: AdapterConfig, recorded: RecordedRobot, known: RecordedChannels | None
) -> tuple[RecordedChannels, Mapping[str, list[RecordedReport]], Difference | None]:
    """Replay once; return the channels of each periodic call, all reports, and the adapter's failure."""
    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(
            _RobotReplay(plugin, config, recorded, known).run(), context=contextvars.copy_context()
        )


class _RobotReplay:
    """One replay of one robot."""

    def __init__(
        self,
        plugin: type[AnyAdapter],
        config: AdapterConfig,
        recorded: RecordedRobot,
        known: RecordedChannels | None,
    ) -> None:
        self._plugin = plugin
        self._config = _with_link(config, recorded.links)
        self._recorded = recorded
        self._known = known
        self._links = RecordedLinks(recorded.links)
        self._state: dict[str, Any] = {}  # survives attempts
        self._said: dict[str, list[RecordedReport]] = {}
        self._learned: dict[int, frozenset[str]] = {}
        self._failure: Difference | None = None
        self._clock: RecordedTime
        self._robot: ReplayedRobot
        self._attempt: asyncio.Task[None]

    async def run(self) -> tuple[RecordedChannels, Mapping[str, list[RecordedReport]], Difference | None]:
        """Feed everything that was recorded."""
        OPENER.set(self._links.open)
        self._clock = RecordedTime(self._recorded.frames[0][1].at)
        self._begin()
        for at, event in _timeline(self._recorded):
            await asyncio.sleep(max(0.0, at - self._clock.time()))
            if self._attempt.done():
                await self._end()
                self._begin()
                await _turns()
            if isinstance(event, str):
                self._robot.at(event)
            else:
                self._links.deliver(*event)
                if event[1].direction == "open":
                    await _turns()
        await asyncio.sleep(0)
        await self._end()
        return self._learned, self._said, self._failure

    def _begin(self) -> None:
        """Begin an attempt to run the robot."""
        limits = self._config.limits.over(self._plugin.limits)
        self._robot = ReplayedRobot(self._recorded, limits, self._clock, self._state, self._known)
        adapter = _adapter(self._plugin, self._config, self._robot)
        self._attempt = asyncio.create_task(_serve(adapter, self._robot))

    async def _end(self) -> None:
        """End the attempt, and store its reports."""
        self._attempt.cancel()
        try:
            await self._attempt
        except (asyncio.CancelledError, *_ENDS):
            pass
        except Exception as error:  # noqa: BLE001 - a replay is meant to find failures of the adapter
            self._note_failure("the adapter failed", error)
        try:
            await self._robot.close()
        except _ENDS:
            pass
        except Exception as error:  # noqa: BLE001 - likewise: the contexts are the adapter's own code
            self._note_failure("the adapter failed to close what it had entered", error)
        for channel, reports in self._robot.said.items():
            self._said.setdefault(channel, []).extend(reports)
        for number, channels in self._robot.channels.items():
            self._learned[number] = self._learned.get(number, frozenset()) | channels

    def _note_failure(self, what: str, error: Exception) -> None:
        """Store the first failure of the adapter as a difference."""
        text = f"{what}: {type(error).__name__}: {error}"
        self._failure = self._failure or Difference(self._clock.time(), self._config.name, "adapter", text)


async def _turns() -> None:
    """Let the adapter open its links, or notice the end of one; no time passes."""
    for _ in range(TURNS):
        await asyncio.sleep(0)


def _timeline(recorded: RecordedRobot) -> Iterator[tuple[float, tuple[str, LinkFrame] | str]]:
    """Yield frames with their link, and channels of recorded reports, in the order of time (Unix s)."""
    frames = [(frame.at, 0, (link, frame)) for link, frame in recorded.frames]
    times = [(said.stamp, 1, channel) for channel, each in recorded.reports.items() for said in each]
    begins = recorded.frames[0][1].at
    events: list[tuple[float, int, Any]] = sorted([*frames, *times], key=lambda event: event[:2])
    for at, _, event in events:
        if at >= begins:
            yield at, event


async def _serve(adapter: Adapter[Any], robot: ReplayedRobot) -> None:
    """Connect and run an adapter until it ends or raises."""
    await adapter.connect()
    running = asyncio.ensure_future(adapter.run())
    try:
        done, _ = await asyncio.wait({running, robot.failed}, return_when=asyncio.FIRST_COMPLETED)
        for each in done:
            each.result()
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def _adapter(plugin: type[AnyAdapter], config: AdapterConfig, robot: ReplayedRobot) -> Adapter[Any]:
    """Return the adapter to feed; raises Refused if it could do other I/O than on its links."""
    if issubclass(plugin, FrameAdapter):
        return create_adapter(plugin, config, robot)
    adapter = plugin.replayed(config, robot)
    if adapter is None:
        raise Refused(
            f"{plugin.__name__} cannot be replayed: it does not override replayed()",
            hint="fleet replay without --through-adapters plays its reports",
        )
    return adapter


def _with_link(config: AdapterConfig, links: tuple[str, ...]) -> AdapterConfig:
    """Return a config with a recorded link; a simulated robot's recorded link is that of its simulator."""
    link = getattr(config, "link", None)
    return config if link is None or link in links else config.model_copy(update={"link": links[0]})
