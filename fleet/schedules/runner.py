"""Starts missions when they are due, and reports the result of every firing.

A firing is on disk before it is started, and each start has a key that identifies it. So a process that dies
in between neither loses nor repeats a firing: the next process looks up open firings by their key, then
starts or skips them. Runs on the event loop; disk access is on a thread.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol, TypeVar

import msgspec

from fleet.clock import Clock
from fleet.errors import StateError
from fleet.model.event import EventKind, EventReport, Severity
from fleet.model.schedule import Firing, ScheduleState
from fleet.schedules.due_firings import MOST, due_firings
from fleet.schedules.model import ScheduleConfig, due_of
from fleet.schedules.store import SKIPPED, STARTED, FiringStore
from fleet.schedules.triggers import firings

log = logging.getLogger(__name__)

EVERY = 1.0  # s between checks: the clock may be set, so a sleep until the due time would be wrong
START_WITHIN = 60.0  # s
RECENT = 3  # firings that users see
T = TypeVar("T")


class StartRequest(msgspec.Struct, frozen=True):
    """Start of a mission for a firing, with the authority of fleet.yaml.

    ``key``: starts with the same key are the same start. ``replace``: conflicting runs are ended first.
    ``without``: robots that do not take part, with the cause of their emergency stop.
    """

    schedule: str
    mission: str
    inputs: Mapping[str, Any]
    key: str
    replace: bool
    without: Mapping[str, str]


class StartResult(msgspec.Struct, frozen=True):
    """Result of a start: the ``run``, or the conflicting run (``busy``), or the reason of a refusal.

    ``left_out`` are robots of the mission that do not take part in the run, with the reasons.
    """

    run: str = ""
    busy: str = ""
    refusal: str = ""
    left_out: Mapping[str, str] = {}


class Starter(Protocol):
    """Starts missions."""

    async def start(self, wanted: StartRequest) -> StartResult:
        """Start a mission or return why not; its key and run are on disk before this returns."""

    async def known(self, key: str) -> str:
        """Return the run that was started with a key, empty if there is none."""


class Schedules:
    """The schedules of an edge. ``stopped`` returns stopped robots with causes; ``tell`` takes events."""

    def __init__(
        self,
        configs: Mapping[str, ScheduleConfig],
        store: FiringStore,
        starter: Starter,
        *,
        clock: Clock,
        tell: Callable[[EventReport], None],
        stopped: Callable[[], Mapping[str, str]],
    ) -> None:
        self._configs = dict(configs)
        self._store, self._starter, self._clock = store, starter, clock
        self._tell, self._stopped = tell, stopped
        self._enabled = {name: one.enabled for name, one in self._configs.items()}
        self._seen: dict[str, float] = {}
        self._next: dict[str, float] = {}  # time before which nothing is due
        self._waiting: dict[str, Firing] = {}  # recorded firings that are neither started nor skipped yet
        self._lock = asyncio.Lock()
        self.problem = ""

    async def run(self) -> None:
        """Check for due firings periodically until cancelled; call ``begin`` first."""
        while True:
            await self.poll()
            await asyncio.sleep(EVERY)

    async def begin(self, *, after_takeover: bool = False) -> None:
        """Resume the open firings of an earlier process; call it before any start.

        ``after_takeover``: another edge has fired the schedules meanwhile, so nothing is made up for.
        """
        async with self._lock:
            if self._store.set_aside is not None:
                self._event("", "what schedules fired before is lost: its file was damaged", Severity.ERROR)
            if not await self._try_disk(self._read):
                return
            if after_takeover:
                self._seen = dict.fromkeys(self._configs, self._clock.time())
            for firing in await asyncio.to_thread(self._store.open):
                config = self._configs.get(firing.schedule)
                run = await self._starter.known(firing.key)
                if run:
                    await self._started(firing, run, "it was started before the edge ended")
                elif config is None or after_takeover:
                    gone = "the schedule is gone"
                    await self._skipped(firing, "another edge had the robots" if config else gone)
                else:  # a made-up start counts as due from now
                    now = self._clock.time() if config.missed == "once" else firing.recorded
                    self._waiting[firing.schedule] = msgspec.structs.replace(firing, recorded=now)

    def _read(self) -> bool:
        """Read the state of the schedules; on a thread."""
        now = self._clock.time()
        for name, config in self._configs.items():
            self._seen[name] = self._store.seen(name, config.digest(), now)
        by_hand = self._store.enabled()
        self._enabled |= {name: on for name, on in by_hand.items() if name in self._configs}
        return True

    async def replace(self, configs: Mapping[str, ScheduleConfig]) -> None:
        """Replace the schedules; waiting firings of removed or changed schedules are skipped."""
        async with self._lock:
            before, self._configs = self._configs, dict(configs)
            self._enabled = {name: one.enabled for name, one in configs.items()}
            self._seen.clear()
            self._next.clear()
            for firing in list(self._waiting.values()):
                new = configs.get(firing.schedule)
                old = before.get(firing.schedule)
                if new is None or old is None or new.digest() != old.digest():
                    await self._skipped(firing, f"the schedule {'is gone' if new is None else 'has changed'}")
            await self._try_disk(self._read)

    async def poll(self) -> None:
        """Record due firings, and start them."""
        async with self._lock:
            if not self._seen.keys() >= self._configs.keys() and not await self._try_disk(self._read):
                return
            for name in self._configs:
                await self._record_firings(name)
            for firing in list(self._waiting.values()):
                await self._try(firing)

    async def handle_event(self, robot: str, event: EventReport) -> None:
        """Handle an event of the history; it fires the schedules that wait for it."""
        for name in due_of(self._configs, event.kind, robot):
            async with self._lock:
                if self._enabled.get(name):
                    why = f"{robot}: {event.text}"
                    await self._record(name, [Firing(name, event.stamp)], self._clock.time(), why)
            await self.poll()

    async def start_now(self, name: str, *, by: str) -> Firing:
        """Fire a schedule by hand, even if disabled; return the result."""
        async with self._lock:
            if name not in self._configs:
                raise StateError(f"there is no schedule {name!r} any more")
            firing = Firing(name, self._clock.time())
            await self._record(name, [firing], firing.due, f"by {by}")
            waiting = self._waiting.get(name)
            if waiting is not None and waiting.due == firing.due:
                await self._try(waiting)
        (last,) = await asyncio.to_thread(self._store.last, name)
        return last

    async def enable(self, name: str, *, enabled: bool, by: str) -> None:
        """Enable or disable a schedule until the next such call; raises StateError."""
        async with self._lock:
            now = self._clock.time()
            await asyncio.to_thread(self._store.enable, name, now, enabled=enabled)
            self._seen[name] = max(self._seen.get(name, now), now)
            self._next.pop(name, None)
            self._enabled[name] = enabled
            waiting = None if enabled else self._waiting.get(name)
            if waiting is not None:
                await self._skipped(waiting, f"disabled by {by}")
            self._event(name, f"{'enabled' if enabled else 'disabled'} by {by}")

    async def states(self) -> list[ScheduleState]:
        """Return all schedules, by name; raises StateError."""
        names = sorted(self._configs)
        last = {name: tuple(await asyncio.to_thread(self._store.last, name, RECENT)) for name in names}
        return [self._state(name, last[name]) for name in names if name in self._configs]

    def _state(self, name: str, last: tuple[Firing, ...]) -> ScheduleState:
        """Return the state of one schedule."""
        config, waiting = self._configs[name], self._waiting.get(name)
        enabled = self._enabled[name]
        return ScheduleState(
            name,
            config.mission,
            trigger_text(config),
            enabled,
            next_of(config, self._clock.time()) if enabled else None,
            waiting.due if waiting else None,
            last,
        )

    # -- firings ---------------------------------------------------------------------------------------

    async def _record_firings(self, name: str) -> None:
        """Record the firings of one schedule since the last check."""
        config, now, seen = self._configs[name], self._clock.time(), self._seen[name]
        if (
            config.trigger is None
            or not self._enabled[name]
            or now <= seen
            or now < self._next.get(name, 0.0)
        ):
            return
        once = config.missed == "once"
        found = await asyncio.to_thread(due_firings, config.trigger, seen, now, late=config.late, once=once)
        ahead = await asyncio.to_thread(next_of, config, now)
        self._next[name] = math.inf if ahead is None else ahead
        new = [Firing(name, at, SKIPPED, why) for at, why in found.skipped]
        if found.missed:
            new.insert(0, Firing(name, found.first_missed, SKIPPED, _missed(found.missed)))
        if found.due is not None:
            new.append(Firing(name, found.due))
        if new:
            await self._record(name, new, now)

    async def _record(self, name: str, new: list[Firing], now: float, why: str = "") -> None:
        """Write firings to disk; a firing to be started replaces an older waiting one."""
        new = [msgspec.structs.replace(firing, recorded=now) for firing in new]
        kept = await self._try_disk(partial(self._store.record, name, new, now))
        if kept is None:
            for firing in new:
                self._report_skipped(firing, f"it cannot be recorded: {self.problem}")
            self._seen[name] = now
            return
        self._seen[name] = now
        for firing in kept:
            if firing.state == SKIPPED:
                self._report_skipped(firing, firing.reason)
                continue
            before = self._waiting.pop(name, None)
            if before is not None:
                await self._skipped(before, "a later one was due as well")
            self._waiting[name] = firing
            if why:
                self._event(name, f"fired: {why}")

    async def _try(self, firing: Firing) -> None:
        """Start a firing, unless it is too late by now."""
        config = self._configs[firing.schedule]
        behind = self._clock.time() - (firing.recorded if config.missed == "once" else firing.due)
        if behind > config.late:
            await self._skipped(
                firing, f"it was due {behind:.0f} s ago, and may be started for {config.late:g} s"
            )
            return
        without = dict(self._stopped())
        wanted = StartRequest(
            firing.schedule, config.mission, config.inputs, firing.key, config.busy == "replace", without
        )
        result = await self._request_start(wanted)
        if result.run:
            left_out = "; ".join(f"{robot} left out: {why}" for robot, why in result.left_out.items())
            await self._started(firing, result.run, left_out)
        elif result.refusal or config.busy != "queue":
            await self._skipped(firing, result.refusal or f"{result.busy or 'another run'} is in its way")

    async def _request_start(self, wanted: StartRequest) -> StartResult:
        """Start a mission; after an exception the key shows whether it was started nevertheless."""
        try:
            async with asyncio.timeout(START_WITHIN):
                return await self._starter.start(wanted)
        except Exception as error:
            log.exception("%s could not be started", wanted.schedule)
            run = await self._starter.known(wanted.key)
            return StartResult(run, refusal="" if run else f"it failed: {type(error).__name__}: {error}")

    async def _started(self, firing: Firing, run: str, why: str) -> None:
        """Record that a firing was started."""
        self._waiting.pop(firing.schedule, None)
        started = msgspec.structs.replace(firing, state=STARTED, run=run)
        # if the write fails, the next process looks it up by its key
        await self._try_disk(partial(self._store.end, started))
        self._event(firing.schedule, f"started as {run}" + f"; {why}" * bool(why), run=run, due=firing.due)

    async def _skipped(self, firing: Firing, why: str) -> None:
        """Record that a firing is skipped."""
        if self._waiting.get(firing.schedule) == firing:
            del self._waiting[firing.schedule]
        skipped = msgspec.structs.replace(firing, state=SKIPPED, reason=why)
        await self._try_disk(partial(self._store.end, skipped))
        self._report_skipped(firing, why)

    async def _try_disk(self, work: Callable[[], T]) -> T | None:
        """Run disk work on a thread; if it fails, set ``problem`` and return None."""
        try:
            done = await asyncio.to_thread(work)
        except StateError as error:
            self.problem = str(error)
            log.error("schedules: %s", error)  # noqa: TRY400 - one line for a person
            return None
        self.problem = ""
        return done

    def _report_skipped(self, firing: Firing, why: str) -> None:
        """Report that a firing is skipped."""
        self._event(firing.schedule, f"skipped: {why}", Severity.WARNING, due=firing.due)

    def _event(self, name: str, text: str, severity: Severity = Severity.INFO, **data: object) -> None:
        """Report an event of a schedule."""
        sentence = f"schedule {name}: {text}" if name else text
        fields = {"schedule": name, **data}
        self._tell(EventReport(self._clock.time(), EventKind.SCHEDULE, sentence, severity, data=fields))


def next_of(config: ScheduleConfig, now: float) -> float | None:
    """Return the next firing of a schedule (Unix s), None if there is none by time."""
    return None if config.trigger is None else next(firings(config.trigger, now), None)


def trigger_text(config: ScheduleConfig) -> str:
    """Return the trigger of a schedule as text."""
    if config.on_event is not None:
        of = f" of {', '.join(config.on_event.robots)}" if config.on_event.robots else ""
        return f"on {config.on_event.kind.value}{of}"
    if config.every is not None:
        return f"every {config.every:g} s"
    return f"{config.cron or config.once}" + f" {config.timezone}" * bool(config.timezone)


def _missed(number: int) -> str:
    """Describe the number of missed firings."""
    many = f"{number} or more firings" if number >= MOST else f"{number} firings" if number > 1 else "it"
    return (
        f"{many} came due while nothing could be started, and {'is' if number == 1 else 'are'} too late now"
    )
