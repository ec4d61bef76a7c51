"""Schedules of an edge, on its event loop and its bus."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.config.load import Loaded
from fleet.config.schema import Sections
from fleet.errors import StateError
from fleet.host.process.robot_process import RobotProcess
from fleet.host.requests.history_recorder import never_raises
from fleet.model.event import EventKind, EventReport
from fleet.model.permission import Permission
from fleet.model.schedule import ScheduleAnswer, ScheduleRequest
from fleet.model.state import RobotState
from fleet.runtime.decoding import decode_json
from fleet.schedules.model import ScheduleConfig
from fleet.schedules.runner import Schedules, Starter
from fleet.schedules.store import FiringStore

log = logging.getLogger(__name__)

WAITING = 100  # events that may wait for the schedules; more are reported and dropped
SERVED_WITHIN = 5.0  # s for the schedules to start with the edge
EventSink = Callable[[str, EventReport], None]


class EdgeSchedules:
    """Schedules of one edge. ``states`` returns those of its robots, also in workers.

    ``starter`` starts missions. Without any schedule it is idle.
    """

    def __init__(
        self,
        config: Sections,
        folder: Path,
        starter: Starter,
        process: RobotProcess,
        states: Callable[[], Iterable[RobotState]],
    ) -> None:
        self.starter, self._senders = starter, process.senders
        self._config = config.schedules
        self._folder, self._states = folder, states
        self._record, self._clock = process.history.add, process.clock
        self._loop = asyncio.get_running_loop()
        self._schedules: Schedules | None = None
        self._problem = ""
        self._served = asyncio.Event()  # or known to have a problem
        self._events: asyncio.Queue[tuple[str, EventReport]] = asyncio.Queue(WAITING)
        self._listens = events_of(self._config)
        self._changed = asyncio.Event()
        self._needed = asyncio.Event()
        if self._config:
            self._needed.set()

    def configure(self, loaded: Loaded) -> None:
        """Use the schedules of another configuration; on the event loop."""
        if loaded.config.schedules == self._config:
            return
        self._config = loaded.config.schedules
        self._listens = events_of(self._config)
        self._changed.set()
        self._needed.set()

    @property
    def problem(self) -> str:
        """Why no schedule can fire; empty while they can."""
        return self._problem or (self._schedules.problem if self._schedules else "")

    async def run(self, *, after_takeover: bool = False) -> None:
        """Fire due schedules until cancelled; ``after_takeover``: another edge did so until now."""
        if after_takeover:  # it has acted on these events
            self._events = asyncio.Queue(WAITING)
        await self._needed.wait()
        try:
            store = await asyncio.to_thread(FiringStore, self._folder)
        except StateError as error:
            self._problem = f"no schedule fires: {error}"
            log.error("%s", self._problem)  # noqa: TRY400 - one line for a person
            self._served.set()
            return
        self._schedules = Schedules(
            self._config,
            store,
            self.starter,
            clock=self._clock,
            tell=lambda event: self._record("", event),
            stopped=self._stopped,
        )
        try:
            await self._schedules.begin(after_takeover=after_takeover)
            self._served.set()
            async with asyncio.TaskGroup() as group:
                group.create_task(self._schedules.run())
                group.create_task(self._hear(self._schedules))
                group.create_task(self._replace(self._schedules))
        except Exception as error:  # nothing awaits this task, so a bug must be logged
            cause = error.exceptions[0] if isinstance(error, ExceptionGroup) else error
            self._problem = f"no schedule fires any more: {type(cause).__name__}: {cause}"
            log.exception("%s", self._problem)
        finally:
            self._served.set()
            self._schedules = None
            await asyncio.to_thread(store.close)  # it waits for the disk, while robots may be being stopped

    def event_receiver(self, sink: EventSink) -> EventSink:
        """Return a receiver for the events of the history, from any thread, that then calls ``sink``."""

        @never_raises
        def hear(robot: str, event: EventReport) -> None:
            if event.kind in self._listens:
                self._loop.call_soon_threadsafe(self._enqueue, robot, event)

        def both(robot: str, event: EventReport) -> None:
            hear(robot, event)
            sink(robot, event)

        return both

    def requested(self, question: Query) -> None:
        """Receive a query, on the bus's thread."""
        asyncio.run_coroutine_threadsafe(self._answer(question), self._loop)

    def _enqueue(self, robot: str, event: EventReport) -> None:
        """Queue an event."""
        try:
            self._events.put_nowait((robot, event))
        except asyncio.QueueFull:
            why = f"an event of {robot} fired no schedule: too many wait"
            self._record("", EventReport(self._clock.time(), EventKind.SCHEDULE, why))

    async def _hear(self, schedules: Schedules) -> None:
        """Pass events to the schedules that wait for them."""
        while True:
            await schedules.handle_event(*await self._events.get())

    async def _replace(self, schedules: Schedules) -> None:
        """Replace the schedules whenever fleet.yaml has changed."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            await schedules.replace(self._config)

    def _stopped(self) -> dict[str, str]:
        """Return the robots whose emergency stop is set, and why."""
        return {
            state.name: f"its emergency stop is set: {state.stop_cause}".removesuffix(": ")
            for state in self._states()
            if state.emergency_stop
        }

    async def _answer(self, question: Query) -> None:
        """Answer a query; each has exactly one reply."""
        try:
            requested = decode_json(question.payload, ScheduleRequest)
            needed = Permission.VIEW if requested.do == "list" else Permission.OPERATE
            what = f"schedule {requested.name}: {requested.do}"
            refusal = self._senders.refusal(question, needed, what, claimed=requested.by)
            requested = msgspec.structs.replace(requested, by=self._senders.proven(question) or requested.by)
            answer = ScheduleAnswer(refusal=refusal) if refusal else await self._answered(requested)
        except (msgspec.DecodeError, StateError) as error:
            answer = ScheduleAnswer(refusal=str(error))
        except Exception as error:
            log.exception("a question for the schedules was not answered")
            answer = ScheduleAnswer(refusal=f"{type(error).__name__}: {error}")
        question.reply(msgspec.json.encode(answer))
        question.close()

    async def _answered(self, requested: ScheduleRequest) -> ScheduleAnswer:
        """Execute a request; raises StateError."""
        if not self._needed.is_set() and requested.do == "list":
            return ScheduleAnswer()
        if requested.do != "list" and requested.name not in self._config:
            known = ", ".join(sorted(self._config)) or "none"
            return ScheduleAnswer(refusal=f"there is no schedule {requested.name!r}; there are: {known}")
        async with asyncio.timeout(SERVED_WITHIN):
            await self._served.wait()
        schedules = self._schedules
        if schedules is None or self._problem:
            return ScheduleAnswer(refusal=self._problem or "this edge fires no schedules now")
        if requested.do == "run":
            firing = await schedules.start_now(requested.name, by=requested.by)
            if not firing.run:
                return ScheduleAnswer(refusal=firing.reason or "it waits: another run is in its way")
        elif requested.do != "list":
            await schedules.enable(requested.name, enabled=requested.do == "enable", by=requested.by)
        return ScheduleAnswer(tuple(await schedules.states()))


def events_of(configs: Mapping[str, ScheduleConfig]) -> frozenset[EventKind]:
    """Return the kinds of events that schedules wait for."""
    return frozenset(one.on_event.kind for one in configs.values() if one.on_event is not None)
