"""Queue of reports for the bus: the newest of each state and every event, sent once per tick.

Reports without a subscriber are not put on the bus, which would cost more than all the rest. The bridge of
this process gets the reports directly.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

from fleet.bus.zenoh_session import Query, ZenohSession, keys_intersect
from fleet.errors import WireError
from fleet.model.event import EventReport
from fleet.model.report import LogReport, NavigationReport, PhotoReport, Report, TelemetryReport
from fleet.wire.checks import check_report
from fleet.wire.databus import encode_report
from fleet.wire.topics import data_key

log = logging.getLogger(__name__)

EVENTS = (NavigationReport, TelemetryReport, LogReport, EventReport)
ALL = "cw/*/data/**"
STEP = 8  # states per step of a flush
WAITING = 200  # events of one robot per tick; beyond it the newest are dropped and counted


class BridgePort(Protocol):
    """Bridge of this process, as the report queue uses it."""

    def open(self, key: str) -> object:
        """Return the outbound channel for a key; None where there is none."""

    def forward(self, batch: Sequence[tuple[Any, Report]]) -> None:
        """Forward reports, each with its outbound channel."""

    def arrived(self, key: str, sample: bytes) -> None:
        """Process a sample of the bus."""


class _Channel:
    """Channel of one twin: its newest report, whether it is queued, and the number of samples put.

    ``last`` is the last report sent; ``uplink`` is its channel to the cloud, None without one.
    """

    __slots__ = ("key", "last", "newest", "refused", "sequence", "uplink", "waits")

    newest: Report

    def __init__(self, key: str, uplink: object) -> None:
        self.key = key
        self.uplink = uplink
        self.sequence = 0
        self.waits = False
        self.last: Report | None = None
        self.refused = False

    def refuse(self, line: str, *values: object) -> None:
        """Log why a report cannot be encoded, for the first of a series only."""
        if not self.refused:
            self.refused = True
            log.warning(line, *values)


class _RobotQueue:
    """Channels and queued events of one robot.

    An adapter may report from its own thread, so each step is atomic, and an entry is complete before it can
    be found.
    """

    def __init__(self, twin: str, outbox: ReportQueue) -> None:
        self.events: list[Report] = []  # at most WAITING; an empty deque takes 0.7 kB
        self._twin = twin
        self._outbox = outbox
        self._channels: dict[tuple[type[Report], str], _Channel] = {}

    def put(self, report: Report) -> None:
        """Queue a report; it is sent with the next ``flush``."""
        if isinstance(report, EVENTS):
            self._put_event(report)
            return
        if type(report) is PhotoReport:
            self._outbox.on_photo(self._twin, report)
        channel = self.channel(report)
        channel.newest = report
        if not channel.waits:
            channel.waits = True
            self._outbox.states.append(channel)

    def channel(self, report: Report) -> _Channel:
        """Return the channel of a report."""
        place = type(report), getattr(report, "sensor", "")
        channel = self._channels.get(place)
        if channel is None:
            channel = self._channels[place] = self._outbox.open(self._twin, report.channel, place[1])
        return channel

    def _put_event(self, report: Report) -> None:
        """Queue an event, unless too many are queued."""
        if type(report) is NavigationReport:
            self._outbox.navigates(report)
        if len(self.events) < WAITING:
            self.events.append(report)
            self._outbox.eventful.append(self)
        else:
            self._outbox.dropped += 1


class ReportQueue:
    """All reports of one process; ``bridge`` is the bridge of this process, if there is one."""

    def __init__(self, bus_session: ZenohSession) -> None:
        self._bus_session = bus_session
        self._publishers = bus_session.publishers(ALL)
        self._channels: list[_Channel] = []
        self.states: deque[_Channel] = deque()  # queued channels, each once
        self.eventful: deque[_RobotQueue] = deque()  # one entry for each queued event
        self.bridge: BridgePort | None = None
        self.navigates: Callable[[NavigationReport], None] = lambda _report: None  # for each action status
        self.on_photo: Callable[[str, PhotoReport], None] = lambda _twin, _report: None  # for each picture
        self.dropped = 0
        bus_session.declare_queryable(ALL, self._requested)

    def sender(self, twin: str) -> Callable[[Report], None]:
        """Return the function that queues one robot's reports, to be sent with the next ``flush``."""
        return _RobotQueue(twin, self).put

    def drop(self, twin: str) -> None:
        """Forget the last reports of a robot that this process no longer runs."""
        begin = f"cw/{twin}/"
        self._channels = [channel for channel in self._channels if not channel.key.startswith(begin)]

    def put_document(self, key: str, sample: bytes) -> None:
        """Put a document on the bus at once, and to this process's bridge (it receives only others)."""
        self._bus_session.put(key, sample)
        if self.bridge is not None:
            self.bridge.arrived(key, sample)

    def flush(self) -> None:
        """Send all queued reports."""
        for _ in self.flushing():
            pass

    def flushing(self) -> Iterator[None]:
        """Send all queued reports, a few per step; later reports wait for the next time.

        A caller that stops in the middle, or fails, loses none of the rest: the next flush continues with it.
        """
        for _ in range(len(self.eventful)):
            if self.eventful:  # another flush may have taken it meanwhile
                robot = self.eventful.popleft()
                report = robot.events.pop(0)
                self._send([(robot.channel(report), report)])
                yield
        left = len(self.states)
        while left > 0:
            self._send(self._newest(min(left, STEP)))
            left -= STEP
            yield

    def _newest(self, most: int) -> list[tuple[_Channel, Report]]:
        """Dequeue up to ``most`` states."""
        batch: list[tuple[_Channel, Report]] = []
        while self.states and len(batch) < most:  # another flush may have taken some meanwhile
            channel = self.states.popleft()
            channel.waits = False
            batch.append((channel, channel.newest))
        return batch

    def open(self, twin: str, name: str, sensor: str) -> _Channel:
        """Open a channel; for a sensor name that is invalid in a key, one without key that sends nothing."""
        try:
            key = data_key(twin, name, sensor or None)
        except (WireError, TypeError) as error:
            log.warning("the %s reports of %s are dropped: %s", name, twin, error)
            return _Channel("", None)
        channel = _Channel(key, self.bridge.open(key) if self.bridge else None)
        self._channels.append(channel)
        return channel

    def _send(self, batch: Sequence[tuple[_Channel, Report]]) -> None:
        """Send reports to the bridge and to subscribers; invalid ones are dropped and counted."""
        crossing = [
            (channel.uplink, report)
            for channel, report in batch
            if self._say(channel, report) and channel.uplink is not None
        ]
        if crossing and self.bridge:
            self.bridge.forward(crossing)

    def _say(self, channel: _Channel, report: Report) -> bool:
        """Put a report on the bus if anyone subscribes; return whether it is valid."""
        if not channel.key:
            self.dropped += 1
            return False
        try:
            check_report(report)
            publisher = self._publishers.wanted(channel.key)
            if publisher is not None:
                publisher.put(encode_report(report, channel.sequence))
                channel.sequence += 1
        except Exception as error:  # noqa: BLE001 - exception barrier: an adapter may put anything into its reports
            self.dropped += 1
            channel.refuse("a report on %s was dropped: %s", channel.key, error)
            return False
        channel.last, channel.refused = report, False
        return True

    def _requested(self, question: Query) -> None:
        """Answer with the last report of each channel in the query; on the bus's thread."""
        try:
            for channel in list(self._channels):
                if channel.last is not None and keys_intersect(question.requested, channel.key):
                    _reply(question, channel, channel.last)
        finally:
            question.close()


def _reply(question: Query, channel: _Channel, report: Report) -> None:
    """Answer with one report; one that cannot be encoded or sent does not prevent the others."""
    try:
        question.reply(encode_report(report, channel.sequence), channel.key)
    except Exception as error:  # noqa: BLE001 - exception barrier: an adapter may put anything into its reports
        channel.refuse("a query of %s cannot be answered: %s", channel.key, error)
