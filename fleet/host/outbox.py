"""Reports on their way to the bus: the newest of each state, every event, put once a turn of the wheel.

What nobody on the bus listens to is not put: that costs more than all the rest. The bridge of this process
gets the reports themselves.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable, Iterator

from fleet.bus.lane import Lane, Publishers, Question, keys_meet
from fleet.errors import WireError
from fleet.model.report import LogReport, NavigationReport, Report, TelemetryReport
from fleet.wire.databus import check_report, encode_report
from fleet.wire.topics import data_key

log = logging.getLogger(__name__)

EVENTS = (NavigationReport, TelemetryReport, LogReport)
ALL = "cw/*/data/**"
Place = tuple[str, str, str]  # twin, channel, sensor
STEP = 4  # states in one step of a flush: less would cost more than the states
WAITING = 200  # events of one robot in one turn; a robot that reports more loses its newest, counted


class _Channel:
    """One channel of one twin: how many samples were put, and the last report."""

    __slots__ = ("key", "last", "refused", "sequence")

    def __init__(self, key: str) -> None:
        self.key = key
        self.sequence = 0
        self.last: Report | None = None
        self.refused = False

    def put(self, report: Report, publishers: Publishers) -> None:
        """Put a report, numbered, where anybody listens."""
        publisher = publishers.wanted(self.key)
        if publisher is not None:
            publisher.put(encode_report(report, self.sequence))
            self.sequence += 1
        self.last = report

    def refuse(self, line: str, *values: object) -> None:
        """Tell why a report cannot be said, the first of a row only."""
        if not self.refused:
            self.refused = True
            log.warning(line, *values)


class Outbox:
    """All reports of one process."""

    def __init__(self, lane: Lane) -> None:
        self._publishers = lane.publishers(ALL)
        self._channels: dict[Place, _Channel] = {}
        self._latest: dict[Place, Report] = {}
        self._events: dict[str, list[Report]] = {}
        self._leaving: Iterator[None] = iter(())  # the flush that is under way
        self.bridge: Callable[[str, Report], None] | None = None  # also gets everything, with its key
        self.dropped = 0
        lane.answer(ALL, self._asked)

    def put(self, twin: str, report: Report) -> None:
        """Take a report; it leaves with the next ``flush``."""
        if not isinstance(report, EVENTS):
            self._latest[_place(twin, report)] = report
            return
        events = self._events.setdefault(twin, [])
        if len(events) < WAITING:
            events.append(report)
        else:
            self.dropped += 1

    def sender(self, twin: str) -> Callable[[Report], None]:
        """Return ``put`` for one twin."""

        def send(report: Report) -> None:
            self.put(twin, report)

        return send

    def flush(self) -> None:
        """Put everything that waits, after what a flush under way has left."""
        for _ in itertools.chain(self._leaving, self.flushing()):
            pass

    def flushing(self) -> Iterator[None]:
        """Put everything that waits, a few reports a step; what comes meanwhile waits for the next time.

        Who leaves off in the middle loses nothing: ``flush`` goes on with it.
        """
        self._leaving = self._put_all()
        return self._leaving

    def _put_all(self) -> Iterator[None]:
        """Put what waits when it is begun."""
        events, self._events = self._events, {}
        latest, self._latest = self._latest, {}
        for twin, reports in events.items():
            for report in reports:
                self._send(_place(twin, report), report)
                yield
        for number, (place, report) in enumerate(latest.items(), 1):
            self._send(place, report)
            if not number % STEP:
                yield

    def _send(self, place: Place, report: Report) -> None:
        """Put one report; what cannot be said is dropped and counted, the first of a row told."""
        channel = self._channels.get(place) or self._open(place)
        if channel is None:
            self.dropped += 1
            return
        try:
            check_report(report)
            channel.put(report, self._publishers)
        except Exception as error:  # noqa: BLE001 - the wall: an adapter may put anything into its reports
            self.dropped += 1
            channel.refuse("a %s report of %s was dropped: %s", report.channel, place[0], error)
            return
        channel.refused = False
        if self.bridge is not None:
            self.bridge(channel.key, report)

    def _open(self, place: Place) -> _Channel | None:
        """Begin a channel; None for a sensor that cannot be part of a key."""
        twin, name, sensor = place
        try:
            key = data_key(twin, name, sensor or None)
        except (WireError, TypeError) as error:
            log.warning("a %s report of %s was dropped: %s", name, twin, error)
            return None
        channel = self._channels[place] = _Channel(key)
        return channel

    def _asked(self, question: Question) -> None:
        """Answer with the last report of each channel that was asked for; on the bus's thread."""
        try:
            for channel in list(self._channels.values()):
                if channel.last is not None and keys_meet(question.asked, channel.key):
                    _reply(question, channel, channel.last)
        finally:
            question.close()


def _reply(question: Question, channel: _Channel, report: Report) -> None:
    """Answer with one report; one that cannot be said, or sent, keeps the asker from no other."""
    try:
        question.reply(encode_report(report, channel.sequence), channel.key)
    except Exception as error:  # noqa: BLE001 - the wall: an adapter may put anything into its reports
        channel.refuse("%s cannot be told to who asks: %s", channel.key, error)


def _place(twin: str, report: Report) -> Place:
    """Return whose report it is: twin, channel, and the sensor where a robot has several of a kind."""
    return twin, report.channel, getattr(report, "sensor", "")
