"""Driver of a roll-out: reads the reports of edges, steps the waves, assigns bundles to the next edges.

All state is in the store. After Ctrl-C the roll-out stays as it is: edges that have a bundle assigned
continue, and no other edge gets one until the roll-out is driven again.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import msgspec

from fleet.clock import Clock
from fleet.errors import FleetError
from fleet.rollout.messages import BundleStage, DesiredState, ObservedState, Rollout
from fleet.rollout.store import FleetStore, StoreError
from fleet.rollout.waves import (
    EdgeStatus,
    Plan,
    RolloutPhase,
    RolloutProgress,
    aborted,
    limit_of,
    step,
    wave_ends,
)

POLL_INTERVAL = 1.0  # s
SILENT_FOR = 60.0  # s; the driver ends if the store does not answer for this time

VERDICTS: Mapping[BundleStage, EdgeStatus] = {
    BundleStage.TAKING: EdgeStatus.OPEN,
    BundleStage.WAITING: EdgeStatus.OPEN,
    BundleStage.DONE: EdgeStatus.DONE,
    BundleStage.RETURNING: EdgeStatus.FAILED,
    BundleStage.FAILED: EdgeStatus.FAILED,
    BundleStage.REFUSED: EdgeStatus.FAILED,
    BundleStage.WITHDRAWN: EdgeStatus.FAILED,
}
"""Status of an edge in the roll-out, by the stage that it reports."""


class RolloutRunning(FleetError):
    """Another roll-out is in progress."""


class RolloutMissing(FleetError):
    """The store has no roll-out."""


def plan_of(rollout: Rollout) -> Plan:
    """Return the plan of a roll-out; raises WavesError."""
    edges = tuple(rollout.targets)
    ends = wave_ends(rollout.waves, len(edges))
    return Plan(edges, ends, limit_of(rollout.stop_if), rollout.parallel, rollout.within)


def verdicts(rollout: Rollout, observed: Mapping[str, ObservedState]) -> dict[str, EdgeStatus]:
    """Return the status of each edge by its report; a report about another bundle is ignored."""
    return {
        edge: VERDICTS[report.stage]
        for edge, report in observed.items()
        if edge in rollout.targets
        and (report.rollout, report.bundle) == (rollout.id, rollout.targets[edge].bundle)
    }


class Driver:
    """Driver of one roll-out. ``tell`` is called after each step; ``sleep`` takes seconds."""

    def __init__(
        self,
        store: FleetStore,
        *,
        clock: Clock,
        tell: Callable[[Rollout, Mapping[str, ObservedState]], None] | None = None,
        sleep: Callable[[float], Any] = asyncio.sleep,
    ) -> None:
        self._store = store
        self._clock = clock
        self._tell = tell
        self._sleep = sleep
        self._all_written = False

    async def begin(self, rollout: Rollout) -> None:
        """Store a new roll-out; raises RolloutRunning while another one is in progress."""
        plan_of(rollout)
        before, revision = await self._store.rollout()
        if before is not None and before.progress.phase is RolloutPhase.RUNNING:
            raise RolloutRunning(
                f"roll-out {before.id} of {before.by} is under way: fleet rollout resume, or abort"
            )
        if before is not None:
            await self._withdraw(before, before.progress.not_done())
        await self._store.replace_rollout(rollout, revision)

    async def drive(self) -> Rollout:
        """Drive the roll-out in the store until it ends; raises StoreError if the store stays silent."""
        heard = self._clock.monotonic()
        while True:
            try:
                rollout, observed = await self.poll()
            except StoreError as error:
                self._all_written = False  # desired states may not have been written
                if self._clock.monotonic() - heard >= SILENT_FOR:
                    raise StoreError(f"{error}; continue with: fleet rollout resume") from error
                await self._sleep(POLL_INTERVAL)
                continue
            heard = self._clock.monotonic()
            if self._tell is not None:
                self._tell(rollout, observed)
            if rollout.progress.phase is not RolloutPhase.RUNNING:
                return rollout
            await self._sleep(POLL_INTERVAL)

    async def poll(self) -> tuple[Rollout, dict[str, ObservedState]]:
        """Take one step; raises StoreError, RolloutMissing."""
        rollout, revision = await self._stored()
        statuses = rollout.progress.statuses
        observed = await self._store.observed(
            edge for edge, each in statuses.items() if each is EdgeStatus.OPEN
        )
        now = self._clock.time()
        progress = step(plan_of(rollout), rollout.progress, verdicts(rollout, observed), now)
        return await self._advance(rollout, progress, revision), observed

    async def abort(self, by: str) -> Rollout:
        """Abort the roll-out: no other edge gets its bundle, and edges that are not done roll back.

        A roll-out that has ended keeps its phase. The withdrawals are written again, because the driver that
        ended it may have been interrupted before it wrote them.
        """
        rollout, revision = await self._stored()
        return await self._advance(rollout, aborted(rollout.progress, f"aborted by {by}"), revision)

    async def _stored(self) -> tuple[Rollout, int]:
        """Return the roll-out in the store; raises RolloutMissing."""
        rollout, revision = await self._store.rollout()
        if rollout is None:
            raise RolloutMissing("there is no roll-out yet; begin one with: fleet apply --fleet")
        return rollout, revision

    async def _advance(self, before: Rollout, progress: RolloutProgress, revision: int) -> Rollout:
        """Store a step, then write the desired state of the edges.

        A new driver writes them all again, because its predecessor may have been interrupted between the two.
        """
        rollout: Rollout = msgspec.structs.replace(before, progress=progress)
        if progress != before.progress:
            await self._store.replace_rollout(rollout, revision)
        over = progress.phase is not RolloutPhase.RUNNING
        for edge, state in progress.statuses.items():
            changed = state is not before.progress.statuses.get(edge) or not self._all_written
            if state is EdgeStatus.OPEN and changed and not over:
                await self._store.put_desired(edge, self._desired(rollout, edge, withdrawn=False))
            elif state is EdgeStatus.OVERDUE and changed and not over:
                await self._withdraw(rollout, [edge])
        if over:
            await self._withdraw(rollout, progress.not_done())
        self._all_written = True
        return rollout

    async def _withdraw(self, rollout: Rollout, edges: Iterable[str]) -> None:
        """Withdraw the bundle from these edges, also from silent ones."""
        for edge in edges:
            await self._store.put_desired(edge, self._desired(rollout, edge, withdrawn=True))

    def _desired(self, rollout: Rollout, edge: str, *, withdrawn: bool) -> DesiredState:
        """Return the desired state of an edge."""
        target = rollout.targets[edge]
        return DesiredState(
            rollout.id, target.bundle, target.parts, rollout.settle, rollout.by, withdrawn=withdrawn
        )
