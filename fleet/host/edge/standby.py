"""An edge of a pair: runs its robots only while it holds the lease.

While another edge has the lease, no link of a robot is open here, so a robot never receives two edges. When
the lease ends, every robot is halted and its link closed before the other edge may open it
(``fleet.standby``).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import uuid
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Protocol

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query
from fleet.config.difference import digest_of
from fleet.config.load import Loaded
from fleet.config.schema import FleetConfig
from fleet.host.edge.pair_stops import PairStops
from fleet.host.process.robot_process import RobotProcess
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.runtime.threads import run_in_thread
from fleet.link.gate import GATE, LinkGate, boot_time
from fleet.model.command import Reply, ReplyStatus
from fleet.robot_config import AdapterConfig
from fleet.standby.bound import MotionBound, motion_from
from fleet.standby.keeper import LeaseKeeper
from fleet.standby.lease import Lease, LeaseEntry, LeaseState, LeaseTimes, Takeover
from fleet.standby.store import LeaseStore, ServiceSettings

log = logging.getLogger(__name__)

FAILOVER = "failover"
ACCEPT = b'{"accept":true}'
"""Request to a standby whose file differs: take the robots over nevertheless."""


def open_gate(config: FleetConfig) -> LinkGate | None:
    """Put a gate in front of all links opened from now on, in an edge of a pair."""
    if config.pair is None:
        return None
    gate = LinkGate()
    GATE.set(gate)
    return gate


class Serve(Protocol):
    """Service that runs only while the robots are this edge's."""

    def __call__(self, *, after_takeover: bool) -> Coroutine[object, object, None]:
        """Serve until cancelled; ``after_takeover``: another edge had the robots until now."""


class Standby:
    """One edge's part in its pair. ``serve`` runs only while the edge holds the lease."""

    def __init__(
        self,
        loaded: Loaded,
        gate: LinkGate,
        process: RobotProcess,
        *,
        serve: Serve,
    ) -> None:
        config = loaded.config
        assert config.pair is not None
        self._edge = config.edge.id
        self._other = next(edge for edge in config.pair if edge != self._edge)
        self._gate = gate
        self._process = process
        self._robots = list(process.robots.values())
        self._stops = PairStops(self._other, process.robots, process.bus.control, process.clock)
        self._serve = serve
        self._serving: asyncio.Task[None] | None = None
        self._terms = LeaseTimes()
        run = f"{self._edge}-{os.getpid()}-{uuid.uuid4().hex[:12]}"
        self.file = digest_of(loaded)  # both edges must agree on it
        lease = Lease(self._edge, run, self._terms, self.file)
        self._keeper = LeaseKeeper(lease, _store(config), self, clock=boot_time)
        self._handing_over: asyncio.Task[None] | None = None
        self._barred = True
        self._why = ""  # why no robot runs here
        self._holders: dict[str, str] = {}  # of twins, by their claims
        self._show_holder, process.holders.changed = process.holders.changed, self._on_holder
        process.claims.pair = frozenset(config.pair)

    @property
    def problem(self) -> str:
        """Why no edge can take over; empty while one can."""
        if self._keeper.lease.differs and self.role == LeaseState.STANDBY.value:
            return (
                f"no takeover from edge {self._other}: its file says something else of robots or missions; "
                "give both the same, and apply it"
            )
        return self._keeper.problem

    def configure(self, loaded: Loaded) -> None:
        """Use the digest of a changed configuration."""
        self.file = self._keeper.lease.config = digest_of(loaded)

    @property
    def role(self) -> str:
        """State of the edge: holder, standby or fenced."""
        return self._keeper.lease.state.value

    @property
    def epoch(self) -> int:
        """Epoch in which it holds the lease, 0 while it does not."""
        return self._gate.epoch if self._keeper.lease.state is LeaseState.HOLDER else 0

    def begin(self) -> None:
        """Bar the robots until the lease is held, and request it; before the robots start."""
        self._bar("no edge of the pair is known to have the lease yet")
        for robot in self._robots:
            robot.controller.permit.refusal = lambda: "this edge does not hold the lease of its pair"
        self._process.bus.control.declare_queryable(keys.failover(self._edge), self._requested)
        self._keeper.begin()

    def ending(self) -> None:
        """Start giving the lease back: this edge ends."""
        self._keeper.hand_over("")

    async def close(self) -> None:
        """Give the lease back; no link may be open any more."""
        tasks = [task for task in (self._serving, self._handing_over) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.to_thread(self._keeper.close)

    # -- calls of the keeper, on its thread ------------------------------------------------------------

    def stops(self) -> dict[str, str]:
        """Return the robots whose emergency stop is set, with its cause."""
        return self._stops.listed

    def permit_writes(self, epoch: int, until: float) -> None:
        """Permit writing to the links of this epoch until ``until``, also for the supervisor's copies."""
        self._process.supervised.write_until(until)
        self._gate.until = until
        self._gate.epoch = epoch

    def changed(self, state: LeaseState) -> None:
        """React to a new state."""
        if state is LeaseState.FENCED:
            log.warning("the lease of the pair ends: every robot is halted, and its link closed")
            run_in_thread(self._process.halt_robots)
            self._soon(self._fenced)
        elif state is LeaseState.HOLDER:
            log.warning("this edge holds the lease of the pair, epoch %d", self._keeper.lease.epoch)
            self._soon(partial(self._holds, self._keeper.lease.epoch, self._keeper.lease.takeover))
        else:
            self._soon(self._waits)

    def saw(self, entry: LeaseEntry | None) -> None:
        """Follow the stops of the lease's holder."""
        if entry is not None and entry.edge != self._edge:
            self._soon(partial(self._follow, entry))

    def _soon(self, call: Callable[[], None]) -> None:
        """Call on the event loop."""
        with contextlib.suppress(RuntimeError):  # the loop has just been closed
            self._process.loop.call_soon_threadsafe(call)

    # -- on the event loop -----------------------------------------------------------------------------

    def _holds(self, epoch: int, takeover: Takeover) -> None:
        """Run the robots; those of another holder may move only once its last motion has ended."""
        if epoch != self._gate.epoch or self._process.runs.ending:
            return
        self._stops.take_over(takeover.entry)
        lease = self._keeper.lease

        def holds() -> bool:
            return self._gate.permits(epoch) and boot_time() < lease.motion_until

        for robot in self._robots:
            begins = motion_from(bound_of(robot.config), takeover, self._terms)
            own = _EpochPermit(begins, holds=holds, reached=partial(_is_reached, robot))
            robot.controller.permit.refusal = own.refusal
            robot.controller.permit.stopped = own.stopped
        after_takeover = takeover.entry is not None and takeover.entry.edge == self._other
        for robot in self._robots if after_takeover else ():
            apart = robot.controller.guard.apart
            if apart is not None and robot.config.start is not None:  # it may be far from there by now
                apart.at = None
                apart.lose_placement(f"edge {self._other} may have moved it since its start")
        self._barred, self._why = False, ""
        for twin in {robot.twin for robot in self._robots}:
            self._on_holder(twin, self._holders.get(twin, ""))
        self._serving = asyncio.ensure_future(self._serve(after_takeover=after_takeover))
        self._process.runs.resume_all(self._robots)

    def _fenced(self) -> None:
        """Bring every robot to a standstill, and close its link."""
        self._bar(f"the lease of the pair has ended here; edge {self._other} may have it")
        if self._serving is not None:
            self._serving.cancel()
            self._serving = None

        # An orderly handover lets the other edge move the robots at once, so it waits for adapters that do
        # not end. Meanwhile the lease expires, and the other edge waits for the bound of each robot.
        async def close_links() -> None:
            await self._process.runs.all_ended(self._robots)
            self._gate.epoch = 0
            self._keeper.robots_released()

        self._handing_over = asyncio.ensure_future(close_links())

    def _waits(self) -> None:
        """Show that another edge has the robots."""
        why = f"edge {self._other} of the pair has the lease"
        if self._keeper.lease.differs:
            why += ", and another file: no takeover"
        if why != self._why:
            self._bar(why)

    def _bar(self, why: str) -> None:
        """End the runs of all robots, and leave their twins to the other edge."""
        self._barred, self._why = True, why
        self._process.runs.suspend_all(self._robots, why)
        for twin in {robot.twin for robot in self._robots}:
            self._on_holder(twin, self._holders.get(twin, ""))

    def _on_holder(self, twin: str, holder: str) -> None:
        """Show the holder of a twin: the other edge, while this one does not hold the lease."""
        self._holders[twin] = holder
        self._show_holder(twin, holder or (self._other if self._barred else ""))

    def _follow(self, entry: LeaseEntry) -> None:
        """Follow the holder's stops, and show that it is the holder."""
        if self._keeper.lease.state is LeaseState.STANDBY:
            self._stops.follow(entry)
            self._waits()

    # -- a deliberate handover -------------------------------------------------------------------------

    def _requested(self, question: Query) -> None:
        """Hand the lease over on request; on the bus's thread."""

        def hand_over() -> None:
            if question.payload == ACCEPT and not self._keeper.lease.differs:
                reply = Reply(
                    FAILOVER, ReplyStatus.REJECTED, f"edge {self._edge} is not blocked by a different file"
                )
            elif question.payload == ACCEPT:
                log.warning("the robots of edge %s are taken over with another file", self._other)
                self._keeper.accept()
                reply = Reply(FAILOVER, ReplyStatus.ACCEPTED)
            elif self._keeper.lease.state is not LeaseState.HOLDER:
                reply = Reply(FAILOVER, ReplyStatus.REJECTED, f"edge {self._edge} does not hold the lease")
            else:
                log.warning("the lease is handed over to edge %s on request", self._other)
                self._keeper.hand_over(self._other)
                reply = Reply(FAILOVER, ReplyStatus.ACCEPTED)
            question.reply(msgspec.json.encode(reply))
            question.close()

        self._soon(hand_over)


class Unpaired:
    """Replaces ``Standby`` in an edge without a pair: everything is served all the time."""

    problem = role = file = ""
    epoch = 0

    def __init__(self, serve: Serve) -> None:
        self._serve = serve
        self._serving: asyncio.Task[None] | None = None

    def configure(self, loaded: Loaded) -> None:
        """Ignore a changed configuration: no other edge needs it."""

    def begin(self) -> None:
        """Start serving."""
        self._serving = asyncio.create_task(self._serve(after_takeover=False), name="schedules")

    def ending(self) -> None:
        """Stop serving: this edge ends."""
        if self._serving is not None:
            self._serving.cancel()

    async def close(self) -> None:
        """Wait until nothing is served."""
        if self._serving is not None:
            await asyncio.gather(self._serving, return_exceptions=True)


def part_in_pair(
    loaded: Loaded,
    gate: LinkGate | None,
    process: RobotProcess,
    serve: Serve,
) -> Standby | Unpaired:
    """Return the edge's part in its pair; ``serve`` runs while the robots are this edge's."""
    return Unpaired(serve) if gate is None else Standby(loaded, gate, process, serve=serve)


def bound_of(config: AdapterConfig) -> MotionBound:
    """Return how long a robot may keep moving without its edge."""
    return MotionBound(config.setpoint_lease, config.failsafe_after)


def _is_reached(robot: LocalRobot) -> bool:
    """Return whether a robot can receive a stop now."""
    return not robot.controller.offline


class _EpochPermit:
    """Motion permit of one robot in one epoch: from ``begins`` on (None: once it was stopped from here)."""

    def __init__(
        self, begins: float | None, *, holds: Callable[[], bool], reached: Callable[[], bool]
    ) -> None:
        self._begins = begins
        self._holds = holds
        self._reached = reached
        self._stopped = False

    def stopped(self) -> None:
        """Record a stop; it counts if the robot can have received it."""
        self._stopped = self._stopped or self._reached()

    def refusal(self) -> str | None:
        """Return why nothing may move the robot now."""
        if not self._holds():
            return "the lease of this edge ends, or has ended"
        if self._begins is None:
            waits = "it may still execute a request of the previous edge: stop it first"
            return None if self._stopped else waits
        left = self._begins - boot_time()
        return f"it may still move for the edge before: wait {left:.1f} s" if left > 0 else None


def _store(config: FleetConfig) -> LeaseStore:
    """Return the lease service of the pair; the name of the lease is the same on both computers."""
    from fleet.standby.nats_store import NatsLease  # noqa: PLC0415 - only where there is a pair

    lease, pair = config.lease, config.pair
    assert lease is not None
    assert pair is not None
    password = lease.password.get_secret_value() if lease.password is not None else None
    ca_file = str(lease.ca_file) if lease.ca_file is not None else None
    settings = ServiceSettings(lease.servers, lease.user, password, ca_file)
    return NatsLease(settings, ".".join(sorted(pair)))
