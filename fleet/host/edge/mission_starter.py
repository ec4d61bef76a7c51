"""Starts missions for schedules: each firing is one run, whose id is derived from the firing's key.

A firing that is started again, by this process or the next one, is thus the same run, known to
``missions.db``. A run has fleet.yaml's authority (``Transport.MISSION``): the author of the robots' rules
also wrote the schedule. Otherwise it is like any other start.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable, Mapping, Sequence

from fleet.clock import Clock
from fleet.config.missions import Mission
from fleet.errors import Refused
from fleet.missions.program import Program
from fleet.missions.report import MissionStartRequest, RunControlRequest
from fleet.missions.runs import BACK_WITHIN, Runs
from fleet.model.command import Transport
from fleet.schedules.runner import StartRequest, StartResult

ENDED_WITHIN = 30.0  # s for replaced runs to end; with BACK_WITHIN and joining, below START_WITHIN
POLL_INTERVAL = 0.1  # s


class MissionStarter:
    """Starts missions for schedules. ``described`` calls back on the loop once robots are described."""

    def __init__(
        self,
        mission: Callable[[str], Mission | None],
        runs: Runs,
        described: Callable[[Callable[[], None]], None],
        clock: Clock,
    ) -> None:
        self._mission, self._runs, self._described, self._clock = mission, runs, described, clock
        self._back_until = clock.monotonic() + BACK_WITHIN

    async def known(self, key: str) -> str:
        """Return the run of a firing's key, empty where none was recorded; waits for the disk."""
        run = self._run_of(key)
        return run if await asyncio.to_thread(self._runs.store.knows, run) else ""

    async def start(self, wanted: StartRequest) -> StartResult:
        """Start a mission, or return why not; the run is on disk before this returns."""
        run = await self.known(wanted.key)
        if run:
            return StartResult(run)
        mission = self._mission(wanted.mission)
        if mission is None:
            return StartResult(refusal=f"there is no mission {wanted.mission!r}")
        by = f"schedule {wanted.schedule}"
        request = MissionStartRequest(inputs=dict(wanted.inputs), run=self._run_of(wanted.key), session_id=by)
        try:
            program = await asyncio.to_thread(mission.program, request.inputs)
            await self._back()
            busy = await self._busy(mission, program, request, replace=wanted.replace)
        except Refused as error:
            return StartResult(refusal=error.reason)
        if busy:
            return StartResult(busy=busy)
        return await self._start(mission, program, request, wanted.without)

    def _run_of(self, key: str) -> str:
        """Return the id of the run of a firing's key: the same in every process of this edge."""
        return hashlib.blake2b(f"{self._runs.edge}/{key}".encode(), digest_size=6).hexdigest()

    async def _back(self) -> None:
        """Wait for all robots to be reachable just after the edge's start, then for their descriptions."""
        robots = self._runs.robots.values()
        while self._clock.monotonic() < self._back_until:
            if all(robot.state().reachable for robot in robots):
                break
            await asyncio.sleep(POLL_INTERVAL)
        described = asyncio.Event()
        self._described(described.set)
        await described.wait()

    async def _busy(
        self, mission: Mission, program: Program, request: MissionStartRequest, *, replace: bool
    ) -> str:
        """Return the runs in the way, once those to be replaced have ended; raises Refused."""
        until = self._clock.monotonic() + ENDED_WITHIN
        requested: set[str] = set()
        while found := self._runs.filling.conflicting_runs(mission, program, request):
            if not replace:
                return f"run {', '.join(found)}"
            if self._clock.monotonic() >= until:
                raise Refused(
                    f"run {', '.join(found)} is to be replaced, and did not end within {ENDED_WITHIN:g} s"
                )
            for run in set(found) - requested:
                refused: list[str] = []
                self._runs.control(
                    run, RunControlRequest("abort", session_id=request.session_id), refused.append
                )
                if not any(refused):
                    requested.add(run)
            await asyncio.sleep(POLL_INTERVAL)
        return ""

    async def _start(
        self, mission: Mission, program: Program, request: MissionStartRequest, without: Mapping[str, str]
    ) -> StartResult:
        """Start a run, and wait until it is on disk."""
        began: asyncio.Future[tuple[Mapping[str, Sequence[str]], str]] = asyncio.Future()

        def hear(_run: str, roles: Mapping[str, Sequence[str]], refusal: str) -> None:
            if not began.done():
                began.set_result((roles, refusal))

        self._runs.start(mission, program, request, Transport.MISSION, hear)
        roles, refusal = await began
        if refusal:
            return StartResult(refusal=refusal)
        if not await asyncio.to_thread(
            self._runs.store.knows, request.run
        ):  # written after it, on one thread
            return StartResult(refusal=self._runs.store.problem)
        left_out = self._runs.filling.left_out(mission, roles)
        return StartResult(
            request.run, left_out={robot: why for robot, why in without.items() if robot in left_out}
        )
