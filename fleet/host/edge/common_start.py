"""Common start of a run's robots, over the same keys as ``fleet send --at``: prepare all, then one instant.

Each robot is prepared by the process that runs it. Until the instant, a problem of one robot cancels the
start of all, by the liveliness token that is held here; so does the end of this process.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import uuid
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.errors import Refused
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.common_start import PINGS, ClockOffset, StartAnswer, StartSignal, check_clock, offset_of
from fleet.model.state import RobotState
from fleet.robot_config import MAIN
from fleet.runtime.decoding import decode_json
from fleet.wire.rules import Kind

log = logging.getLogger(__name__)

AHEAD = 1.0  # s between the announcement and the instant
SPARE = 0.2  # s before the instant by which every process must have confirmed it, or the start is cancelled
PING_WITHIN = 1.0  # s
END_WITHIN = 3600.0  # s for the started requests; the run's own limits are shorter


class CommonStart:
    """One start of several robots of a run. All methods and callbacks run on the event loop.

    ``state_of`` returns a robot's state, which names its edge and process.
    """

    def __init__(
        self,
        session: ZenohSession,
        clock: Clock,
        state_of: Callable[[str], RobotState],
    ) -> None:
        self._session, self._clock = session, clock
        self._loop = asyncio.get_running_loop()
        self._state_of = state_of
        self._id = uuid.uuid4().hex
        self._tokens: list[Callable[[], None]] = []
        self._measured: dict[str, asyncio.Task[None]] = {}  # by edge
        self._stamp = float("inf")
        self._failed: Callable[[str], None] = lambda _: None
        self._tasks: set[asyncio.Task[None]] = set()
        self._clocks: dict[tuple[str, str], ClockOffset] = {}

    def prepare(
        self,
        robot: str,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        identity: str,
        heard: Callable[[Reply], None],
    ) -> None:
        """Ask a robot to prepare; ``heard`` gets the result, and later the replies of the started request."""
        edge = self._state_of(robot).edge
        if edge not in self._measured:
            self._tokens.append(self._session.token(keys.starting(edge, self._id)))
            self._measured[edge] = self._task(self._measure(edge))
        parameters = {"kind": kind, "wait": "1", "start": self._id, "id": identity, "way": transport.value}
        answers = 0

        def receive(reply: Reply) -> None:
            nonlocal answers
            answers += 1
            if answers > 1 and not reply.ok and reply.done is None and self._clock.time() < self._stamp:
                self._fail(f"{robot}: {reply.reason}")
            else:
                heard(reply)

        def end() -> None:
            if answers == 0:
                receive(Reply(robot, ReplyStatus.TIMEOUT, "its process does not answer"))

        self._session.request_later(
            keys.prepare(edge, robot),
            payload,
            timeout=END_WITHIN,
            parameters=parameters,
            on_answer=lambda data: self._soon(partial(receive, decode_json(data, Reply))),
            on_end=partial(self._soon, end),
        )

    def begin(self, robots: Sequence[str], failed: Callable[[str], None]) -> None:
        """Announce the instant to all processes; ``failed`` gets the reason of a cancelled start."""
        self._failed = failed
        self._task(self._begin(robots))

    def withdraw(self) -> None:
        """Cancel everything that has not started."""
        while self._tokens:
            self._tokens.pop()()

    async def _begin(self, robots: Sequence[str]) -> None:
        """Announce the instant once the clocks are measured, and check that every process confirmed it."""
        await asyncio.gather(*self._measured.values())
        processes = {(self._state_of(robot).edge, self._state_of(robot).worker or MAIN) for robot in robots}
        try:
            for edge, process in sorted(processes):
                where = f"edge {edge}" if process == MAIN else f"worker {process} of edge {edge}"
                check_clock(where, self._clocks.get((edge, process)))
        except Refused as error:
            self._fail(error.reason)
            return
        self._stamp = self._clock.time() + AHEAD
        requested = msgspec.json.encode(StartSignal(self._id, self._stamp))
        found: dict[str, str] = {}
        answers = [self._answers(edge, requested, AHEAD - SPARE) for edge in self._measured]
        for answer in itertools.chain(*await asyncio.gather(*answers)):
            found |= answer.robots
        unheard = "its process did not take the instant in time"
        if self._clock.time() > self._stamp - SPARE / 2:
            found = {}
        against = {robot: found.get(robot, unheard) for robot in robots}
        trouble = "; ".join(f"{robot}: {why}" for robot, why in against.items() if why)
        if trouble:
            self._fail(trouble)
            return
        await asyncio.sleep(max(0.0, self._stamp - self._clock.time()) + AHEAD)
        self.withdraw()

    async def _measure(self, edge: str) -> None:
        """Measure the clocks of an edge's processes; the fastest of several pings counts."""
        for _ in range(PINGS):
            sent = self._clock.time()
            for answer in await self._answers(edge, msgspec.json.encode(StartSignal()), PING_WITHIN):
                offset = offset_of(sent, answer.time, self._clock.time())
                known = self._clocks.get((edge, answer.process))
                if known is None or offset.bound < known.bound:
                    self._clocks[edge, answer.process] = offset

    async def _answers(self, edge: str, requested: bytes, within: float) -> list[StartAnswer]:
        """Query all processes of an edge; return the answers that arrive in time."""
        found: list[StartAnswer] = []
        ended = asyncio.Event()

        def receive(data: bytes) -> None:
            with contextlib.suppress(msgspec.DecodeError):
                found.append(decode_json(data, StartAnswer))

        self._session.request_later(
            keys.starts(edge),
            requested,
            timeout=within,
            on_answer=lambda data: self._soon(partial(receive, data)),
            on_end=partial(self._soon, ended.set),
        )
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within + SPARE):
                await ended.wait()
        return found

    def _fail(self, why: str) -> None:
        """Cancel the start, and report the reason, once."""
        self.withdraw()
        failed, self._failed = self._failed, lambda _: None
        failed(why)

    def _soon(self, call: Callable[[], object]) -> None:
        """Run a call on the event loop; from any thread."""
        with contextlib.suppress(RuntimeError):  # the loop has just been closed
            self._loop.call_soon_threadsafe(call)

    def _task(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Start a task of this object."""
        task = self._loop.create_task(work, name=f"start:{self._id}")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
