"""Recording of running edges: joins their buses, queries their history, writes until the end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from fleet.bus import keys
from fleet.bus.bus import Bus
from fleet.bus.edge_buses import EdgeBuses
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.history.event_filter import EventFilter
from fleet.history.record import Record
from fleet.model.permission import Permission
from fleet.model.schedule import ScheduleRequest
from fleet.record.recorded_keys import REPORTS, published, requested_first
from fleet.record.recorder import Recorder
from fleet.record.ring import Ring
from fleet.record.task import RecordTask
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

EVERY = 0.4
"""Seconds between writes to disk: the most that a killed recorder loses, plus the time of one write."""
HISTORY_EVERY = 1.0  # s between queries of the history; the edge reads each answer from its disk
ANSWER_WITHIN = 2.0  # s for states and history
PERSISTENT_EVERY = 5.0
"""Seconds between queries of fences, bodies and schedules, of which only changes are recorded."""
OVERLAP = 2.0  # s of overlap between queries: workers write their events later than the edge


async def record(
    task: RecordTask,
    directory: Path,
    ended: asyncio.Event,
    clock: Clock,
    *,
    on_problem: Callable[[str], None] = lambda _problem: None,
) -> int:
    """Record until ``ended``; return the number of messages. ``on_problem`` gets errors, '' when they end.

    Raises StateError if the folder cannot be used.
    """
    recorder = Recorder(Ring(Path(task.folder), task.bounds), clock)
    joined = _EdgeSubscriptions(recorder, clock)
    edges = EdgeBuses(
        task.edges, directory, clock, only=task.only, opened=joined.opened, changed=joined.connection_changed
    )
    joining = asyncio.create_task(edges.run(), name="edges")
    known: str | None = None
    try:
        while not ended.is_set():
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(EVERY):
                    await ended.wait()
            for edge, bus in edges.joined.items():
                joined.request(edge, bus.control)
            await asyncio.to_thread(recorder.write)
            if recorder.problem != known:
                known = recorder.problem
                on_problem(known)
    finally:
        joining.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await joining
        await asyncio.to_thread(recorder.close)
    return recorder.recorded


class _EdgeSubscriptions:
    """Subscriptions and queries on the joined buses."""

    def __init__(self, recorder: Recorder, clock: Clock) -> None:
        self._recorder = recorder
        self._clock = clock
        self._history = _HistoryReader(recorder, clock)
        self._requested: dict[str, float] = {}

    def connection_changed(self, edge: str, problem: str | None) -> None:
        """Log which edge is recorded."""
        if problem is None:
            log.info("edge %s is recorded", edge)
        else:
            log.debug("edge %s is not recorded: %s", edge, problem)

    def opened(self, edge: str, bus: Bus) -> None:
        """Subscribe on the bus of an edge, after querying whose the twins are; blocks."""
        for key in requested_first(edge):
            for answered, data in bus.control.request(key, b"", timeout=ANSWER_WITHIN):
                self._recorder.add(edge, answered, data)
        for key in published(edge):
            bus.control.subscribe(key, partial(self._recorder.add, edge))
        for key in (REPORTS, keys.frames(edge, "*")):
            bus.reports.subscribe_batches(key, partial(self._recorder.add_many, edge))

    def request(self, edge: str, control: ZenohSession) -> None:
        """Query the newest events of an edge, and periodically the values that rarely change."""
        self._history.request(edge, control)
        now = self._clock.monotonic()
        if now - self._requested.get(edge, float("-inf")) < PERSISTENT_EVERY:
            return
        self._requested[edge] = now
        schedules = keys.as_console(keys.schedules(edge), Permission.VIEW.word, control.identity)
        for key, requested, payload in (
            (keys.description(edge, "*"), keys.description(edge, "*"), b""),
            (keys.schedules(edge), schedules, msgspec.json.encode(ScheduleRequest())),
        ):
            control.request_later(
                requested,
                payload,
                timeout=ANSWER_WITHIN,
                on_answer=partial(self._recorder.add, edge, key),
                on_end=lambda: None,
            )


class _HistoryReader:
    """Events of the edges' histories since the recorder began, without duplicates."""

    def __init__(self, recorder: Recorder, clock: Clock) -> None:
        self._recorder = recorder
        self._clock = clock
        self._began = clock.time()
        self._seen: dict[bytes, float] = {}
        self._requested: set[str] = set()
        self._until: dict[str, float] = {}
        self._lock = threading.Lock()

    def request(self, edge: str, control: ZenohSession) -> None:
        """Query the newest events, unless they were just queried or an answer is pending."""
        now = self._clock.time()
        if edge in self._requested or abs(now - self._until.get(edge, 0.0)) < HISTORY_EVERY:
            return
        self._requested.add(edge)
        since = max(self._began, self._until.get(edge, now) - OVERLAP)
        control.request_later(
            keys.history(edge),
            msgspec.json.encode(EventFilter(since=since)),
            timeout=ANSWER_WITHIN,
            on_answer=lambda data: self._answered(edge, data, now),
            on_end=lambda: self._requested.discard(edge),
        )

    def _answered(self, edge: str, data: bytes, requested: float) -> None:
        """Take the new events; on the bus's thread."""
        try:
            events = decode_json(data, list[Record])
        except msgspec.DecodeError as error:
            log.warning("the history of %s cannot be read: %s", edge, error)
            return
        with self._lock:
            marks = [(msgspec.json.encode((edge, event)), event) for event in events]
            self._recorder.add_events(edge, [event for mark, event in marks if mark not in self._seen])
            kept = {mark: at for mark, at in self._seen.items() if requested - at < 10 * OVERLAP}
            self._seen = kept | dict.fromkeys((mark for mark, _ in marks), requested)
            self._until[edge] = requested
