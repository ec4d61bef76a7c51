"""Reports on their way to the bus: the newest of each state, every event, put once a turn of the wheel."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping

from fleet.bus.lane import Lane, Publisher, Question, keys_meet
from fleet.model.report import LogReport, NavigationReport, Report, TelemetryReport
from fleet.wire.databus import encode_report
from fleet.wire.topics import data_key

log = logging.getLogger(__name__)

EVENTS = (NavigationReport, TelemetryReport, LogReport)
WAITING = 200  # events of one robot in one turn; a robot that reports more loses its newest, counted


class Outbox:
    """All reports of one process."""

    def __init__(self, lane: Lane) -> None:
        self._lane = lane
        self._publishers: dict[str, Publisher] = {}
        self._sequences: dict[str, int] = {}
        self._latest: dict[tuple[str, str], Report] = {}
        self._events: dict[str, list[Report]] = {}
        self._refused: set[str] = set()
        self._last: dict[str, bytes] = {}
        self._lock = threading.Lock()  # the last samples are read on the bus's thread
        self.dropped = 0
        lane.answer("cw/*/data/**", self._asked)

    def put(self, twin: str, report: Report) -> None:
        """Take a report; it leaves with the next ``flush``."""
        if not isinstance(report, EVENTS):
            self._latest[(twin, report.channel)] = report
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
        """Put everything that waits."""
        for _ in self.flushing():
            pass

    def flushing(self) -> Iterator[None]:
        """Put everything that waits, one report a step; what comes meanwhile waits for the next time."""
        events, self._events = self._events, {}
        latest, self._latest = self._latest, {}
        for twin, reports in events.items():
            for report in reports:
                self._send(twin, report)
                yield
        for (twin, _), report in latest.items():
            self._send(twin, report)
            yield

    def _send(self, twin: str, report: Report) -> None:
        """Encode and put one report; what cannot be said is dropped and counted, the first of a row told."""
        key = data_key(twin, report.channel)
        sequence = self._sequences.get(key, 0)
        try:
            sample = encode_report(report, sequence)
        except Exception as error:  # noqa: BLE001 - the wall: an adapter may put anything into its reports
            self.dropped += 1
            if key not in self._refused:
                self._refused.add(key)
                log.warning("a %s report of %s was dropped: %s", report.channel, twin, error)
            return
        self._refused.discard(key)
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._lane.publisher(key)
        self._sequences[key] = sequence + 1
        with self._lock:
            self._last[key] = sample
        publisher.put(sample)

    def _asked(self, question: Question) -> None:
        """Answer with the last sample of each channel that was asked for; on the bus's thread."""
        with self._lock:
            last: Mapping[str, bytes] = dict(self._last)
        for key, sample in last.items():
            if keys_meet(question.asked, key):
                question.reply(sample, key)
        question.close()
