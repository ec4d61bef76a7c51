"""Agent of one edge: installs the desired bundle, has the edge apply it, and reports the progress.

The agent is a separate process, so that a bundle that prevents the start of the edge can still be replaced,
and no robot waits for the agent. The edge decides which changes it can make now, as with ``fleet apply``.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet.clock import Clock
from fleet.errors import FleetError, StateError
from fleet.health.aggregate import LEVELS
from fleet.model.health import Level
from fleet.rollout.bundle import Bundle, BundleError, verify_bundle
from fleet.rollout.decision import AgentAction, AgentRecord, Refusal, action, version_refusal
from fleet.rollout.edge_here import ApplyResult, EdgeHere, Running
from fleet.rollout.faults import got_worse
from fleet.rollout.installation import Installation
from fleet.rollout.messages import (
    LONGEST_LINE,
    LONGEST_SETTLE,
    LONGEST_WHY,
    MOST_LINES,
    BundleStage,
    DesiredState,
    ObservedState,
)
from fleet.rollout.signature import PublicKey
from fleet.rollout.store import EdgeStore, StoreError
from fleet.version import __version__

log = logging.getLogger(__name__)

MOST_REFUSALS = 100
HEALTH_EVERY = 1.0  # s
REPORT_EVERY = 60.0  # s, also without changes
MOST_WORSE = 3  # parts of an edge that a report names
GONE_FOR = 60.0  # s; after this time, an edge that ran before the bundle and has not come back is rolled back


class Agent:
    """Agent of one edge. ``sleep`` takes seconds."""

    def __init__(
        self,
        edge: str,
        installation: Installation,
        trusted: Mapping[str, PublicKey],
        store: EdgeStore,
        here: EdgeHere,
        *,
        clock: Clock,
        sleep: Callable[[float], Any] = asyncio.sleep,
    ) -> None:
        self._edge = edge
        self._installation = installation
        self._trusted = trusted
        self._store = store
        self._here = here
        self._clock = clock
        self._sleep = sleep
        self.record = installation.record()
        self.problem = ""  # why the store cannot be used; empty while it can
        self._desired: DesiredState | None = None
        self._reported: AgentRecord | None = None
        self._reported_at = 0.0
        self._gone_since: float | None = None  # monotonic
        self._actions = {
            AgentAction.REST: self._rest,
            AgentAction.TAKE: self._install,
            AgentAction.GO_ON: self._go_on,
            AgentAction.RETURN: self._withdraw,
            AgentAction.GO_ON_BACK: self._go_on_back,
            AgentAction.GIVE_UP: self._give_up,
        }

    async def run(self, every: float) -> None:
        """Poll the store until cancelled, every ``every`` seconds."""
        while True:
            try:
                await self.poll()
            except Exception:  # an agent that has ended cannot install the bundle that would repair it
                log.exception("the agent of edge %s failed; it looks again", self._edge)
            await self._sleep(every)

    async def poll(self) -> None:
        """Poll once: take the next step and report changes. A silent store interrupts nothing."""
        try:
            self._desired = await self._store.desired()
            self.problem = ""
        except FleetError as error:  # continue with the last known desired state
            self._silent(error)
        try:
            await self._actions[action(self.record, self._desired)](self._desired)
        except (StoreError, StateError) as error:  # retried at the next poll
            self._silent(error)
        await self._report()

    # -- actions ---------------------------------------------------------------------------------------

    async def _rest(self, desired: DesiredState | None) -> None:
        """Do nothing."""

    async def _install(self, desired: DesiredState | None) -> None:
        """Fetch, check and activate a bundle; nothing changes before every check has passed."""
        assert desired is not None
        self._keep(
            rollout=desired.rollout,
            bundle=desired.bundle,
            by=desired.by,
            stage=BundleStage.TAKING,
            why="",
            lines=(),
        )
        await self._report()
        try:
            data = await self._store.bundle(desired.bundle, desired.parts)
            bundle = self._opened(data, desired)
        except BundleError as error:
            self._refuse(_one_line(error))
            return
        try:
            await asyncio.to_thread(self._place, bundle, desired.bundle)
        except FleetError as error:
            self._settle(BundleStage.FAILED, _one_line(error))
            return
        await self._go_on(desired)

    def _opened(self, data: bytes, desired: DesiredState) -> Bundle:
        """Return the bundle if this edge accepts it; raises BundleError."""
        address, bundle = verify_bundle(data, self._trusted, desired.bundle)
        if self._edge not in bundle.edges:
            raise BundleError(f"the bundle is for {', '.join(bundle.edges[:5])}, not for edge {self._edge}")
        if why := version_refusal(self.record, address, bundle.version):
            raise BundleError(why)
        return bundle

    def _place(self, bundle: Bundle, address: str) -> None:
        """Check the files of a bundle and activate them; raises FleetError."""
        installation = self._installation
        installation.stage(bundle, address)
        before = installation.folder_of(installation.current) if installation.current else None
        code = self._here.check(installation.folder_of(address), before)
        found = self._here.running()
        self._keep(
            stage=BundleStage.WAITING,
            highest=max(bundle.version, self.record.highest),
            highest_bundle=address if bundle.version >= self.record.highest else self.record.highest_bundle,
            placed=self._clock.time(),
            health=found.health if found else "",
            faults=found.faults if found else None,
            adapters=code.adapters,
            loaded=(),
            files=code.files,
        )
        installation.activate(address)

    async def _go_on(self, desired: DesiredState | None) -> None:
        """Apply the pending changes; done when all are applied and the edge is as healthy as before."""
        record = self.record
        if self._installation.current != record.bundle:  # killed between writing the record and activating
            await asyncio.to_thread(self._installation.activate, record.bundle)
        applied = await asyncio.to_thread(self._applied)
        failed = applied.failed or await self._gone()
        if not failed and not applied.waits:
            failed = await self._worse(min(desired.settle, LONGEST_SETTLE) if desired else 0.0)
        self._keep(lines=_bounded(applied.lines) or self.record.lines)
        if failed:
            await self._go_back(BundleStage.FAILED, failed)
        elif applied.waits:
            self._keep(stage=BundleStage.WAITING, why=applied.waits[:LONGEST_WHY])
        else:
            self._keep(running=record.bundle)
            self._settle(BundleStage.DONE, "")
            await asyncio.to_thread(self._installation.remove_unused)

    async def _withdraw(self, _desired: DesiredState | None) -> None:
        """Roll back, because the roll-out ended before this edge was done."""
        await self._go_back(BundleStage.WITHDRAWN, f"withdrawn while it waited: {self.record.why}")

    async def _go_back(self, ends: BundleStage, why: str) -> None:
        """Activate and apply the previous bundle."""
        if not self.record.running or self.record.running == self.record.bundle:
            self._settle(BundleStage.FAILED, f"{why}; there is no bundle before to go back to")
            return
        running = await asyncio.to_thread(self._here.running)
        files = self.record.files if running and running.since > self.record.placed else ()
        now = self._clock.time()
        self._keep(
            stage=BundleStage.RETURNING, ends=ends, why=why[:LONGEST_WHY], placed=now, loaded=(), files=files
        )
        await asyncio.to_thread(self._installation.activate, self.record.running)
        await self._go_on_back(None)

    async def _go_on_back(self, _desired: DesiredState | None) -> None:
        """Apply the pending changes of the rollback."""
        if self._installation.current != self.record.running:
            await asyncio.to_thread(self._installation.activate, self.record.running)
        applied = await asyncio.to_thread(self._applied)
        running = await asyncio.to_thread(self._here.running)
        if running is not None and (applied.failed or applied.waits):
            log.warning("edge %s is on its way back: %s", self._edge, applied.failed or applied.waits)
            return
        self._settle(self.record.ends, self.record.why)

    async def _give_up(self, _desired: DesiredState | None) -> None:
        """Record that the roll-out ended before this edge changed anything."""
        self._settle(BundleStage.WITHDRAWN, "the roll-out ended before it was taken")

    def _applied(self) -> ApplyResult:
        """Have the edge apply the active bundle, including changed code and files that only a start reads."""
        try:
            applied = self._here.apply(f"roll-out {self.record.rollout} of {self.record.by}")
        except FleetError as error:
            return ApplyResult(failed=_one_line(error))
        if applied.failed or applied.waits:
            return applied
        running = self._here.running()
        started = running is None or running.since > self.record.placed
        loaded = self.record.loaded
        for adapter in () if started else (each for each in self.record.adapters if each not in loaded):
            if why := self._here.reload(adapter):
                return msgspec.structs.replace(applied, waits=why)
            self._keep(loaded=(*self.record.loaded, adapter))
        if self.record.files and not started:
            why = f"restart the edge: only its start reads {', '.join(self.record.files[:5])}"
            return msgspec.structs.replace(applied, waits=why)
        return applied

    async def _gone(self) -> str:
        """Return why the edge counts as lost with the active bundle; empty while it runs or may come back.

        An edge that did not run before the bundle is not expected to run.
        """
        running = await asyncio.to_thread(self._here.running)
        now = self._clock.monotonic()
        if running is not None or not self.record.health:
            self._gone_since = None
            return ""
        self._gone_since = now if self._gone_since is None else self._gone_since
        if now - self._gone_since < GONE_FOR:
            return ""
        self._gone_since = None
        return f"edge {self._edge} ran before, and has been gone for {GONE_FOR:.0f} s with the bundle"

    async def _worse(self, settle: float) -> str:
        """Watch the edge for ``settle`` seconds; return what is worse at their end, empty if nothing is."""
        until = self._clock.monotonic() + settle
        while True:
            found = await asyncio.to_thread(self._here.running)
            if found is None:
                return f"edge {self._edge} ended after it took the bundle"
            if self._clock.monotonic() >= until:
                break
            await self._sleep(HEALTH_EVERY)
        return _worse_than(self.record, found)

    # -- record and reports ----------------------------------------------------------------------------

    def _refuse(self, why: str) -> None:
        """Record the refusal of a bundle; nothing has changed on the edge."""
        record = self.record
        refusal = Refusal(self._clock.time(), record.rollout, record.bundle, why[:LONGEST_WHY])
        self._keep(refusals=(*record.refusals, refusal)[-MOST_REFUSALS:])
        self._settle(BundleStage.REFUSED, why)

    def _settle(self, stage: BundleStage, why: str) -> None:
        """Record the end of this edge's part in the roll-out."""
        level = logging.INFO if stage is BundleStage.DONE else logging.WARNING
        bundle = self.record.bundle[:12]
        log.log(level, "bundle %s: %s%s", bundle, stage.value, f": {why}" if why else "")
        self._keep(stage=stage, why=why[:LONGEST_WHY], adapters=(), loaded=(), files=(), faults=None)

    def _keep(self, **changes: Any) -> None:
        """Change the record, first on disk; raises StateError."""
        record: AgentRecord = msgspec.structs.replace(self.record, **changes)
        self._installation.save_record(record)
        self.record = record

    def _silent(self, error: FleetError) -> None:
        """Keep and log why the store cannot be used; log a repeated reason only once."""
        if str(error) != self.problem:
            log.warning("%s", error)
        self.problem = str(error)

    async def _report(self) -> None:
        """Write a report to the store if the record has changed or the last report is old."""
        record, now = self.record, self._clock.time()
        if self._reported is record and now - self._reported_at < REPORT_EVERY:
            return
        running = await asyncio.to_thread(self._here.running)
        observed = ObservedState(
            self._edge,
            record.rollout,
            record.bundle,
            record.stage,
            record.why,
            record.lines,
            running=self._installation.current,
            version=record.highest,
            health=running.health if running else "not running",
            stamp=now,
            fleet=__version__,
        )
        try:
            await self._store.report(observed)
        except FleetError as error:
            self._silent(error)
        else:
            self._reported, self._reported_at = record, now


def _worse_than(record: AgentRecord, found: Running) -> str:
    """Return what is worse on a running edge than before the bundle; empty if nothing is.

    An edge that did not run before must come up ``ok`` or ``degraded``.
    """
    if record.health and record.faults is not None:
        worse = got_worse(record.faults, found.faults)
        more = f"; and {len(worse) - MOST_WORSE} more" if len(worse) > MOST_WORSE else ""
        return "; ".join(worse[:MOST_WORSE]) + more
    if LEVELS[found.health] <= (LEVELS[record.health] if record.health else Level.DEGRADED):
        return ""
    then = f"was {record.health}" if record.health else "did not run before"
    return f"the edge is {found.health}, {then}: {found.cause}"


def _bounded(lines: tuple[str, ...]) -> tuple[str, ...]:
    """Return the lines of a report, cut to the permitted number and length."""
    return tuple(line[:LONGEST_LINE] for line in lines[:MOST_LINES])


def _one_line(error: FleetError) -> str:
    """Return an error on one line."""
    return "; ".join(str(error).splitlines()) or type(error).__name__
