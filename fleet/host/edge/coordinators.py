"""Robots of this edge in runs of other edges: their leases, and the reaction when one lapses."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import Query, ZenohSession
from fleet.clock import Clock
from fleet.config.other_edges import PartnerConfig
from fleet.host.safety.admission import LEAVE
from fleet.host.safety.source_policy import SourcePolicy
from fleet.missions.coordination import CoordinatorLeases, ExpiredLease, LeaseAnswer, RobotLeaseRequest
from fleet.missions.run import RunPort
from fleet.missions.run_robots import COMES_DOWN
from fleet.model.command import Origin, Reply, Transport
from fleet.model.event import EventKind, EventReport, Severity
from fleet.runtime.decoding import decode_json

log = logging.getLogger(__name__)

POLL_INTERVAL = 0.5  # s


class Coordinators:
    """Other edges that may have this edge's robots in their runs (``partners`` of fleet.yaml).

    ``site`` is the origin of this edge's frame; ``record`` writes the history.
    """

    def __init__(
        self,
        edge: str,
        partners: Mapping[str, PartnerConfig],
        robots: Mapping[str, RunPort],
        policies: Mapping[str, SourcePolicy],
        *,
        site: tuple[float, float, float] | None,
        record: Callable[[str, EventReport], None],
        soon: Callable[[Callable[[], None]], None],
        clock: Clock,
    ) -> None:
        self._edge, self._robots, self._policies, self._site = edge, robots, policies, site
        self._trusted = {name for name, partner in partners.items() if partner.coordinates}
        self._record, self._soon, self._clock = record, soon, clock
        self._leases = CoordinatorLeases()

    def declare(self, control: ZenohSession, every: Callable[[float, Callable[[], None]], object]) -> None:
        """Serve requests for leases, and check the present ones periodically."""
        if self._trusted:
            control.declare_queryable(keys.coordinator(self._edge), self._requested)
            every(POLL_INTERVAL, self.check)

    def check(self) -> None:
        """Make robots safe whose leases have lapsed; on the event loop."""
        for lapsed in self._leases.lapsed(self._clock.monotonic()):
            try:
                self._secure(lapsed)
            except Exception:  # each lapsed lease is reported only once, and an error would end the timer
                log.exception("%s could not be made safe", lapsed.robot)

    def _requested(self, question: Query) -> None:
        """Receive a request for a lease; on the bus's thread."""
        self._soon(partial(self._answer, question))

    def _answer(self, question: Query) -> None:
        """Grant or renew a lease, or answer why not; on the event loop."""
        try:
            request = decode_json(question.payload, RobotLeaseRequest)
        except msgspec.DecodeError as error:
            refusal = str(error)
        else:
            refusal = self._refusal(request)
            if not refusal:
                self._leases.grant(request, self._clock.monotonic())
        answer = LeaseAnswer(refusal, self._site)
        question.reply(msgspec.json.encode(answer), keys.coordinator(self._edge))
        question.close()

    def _refusal(self, request: RobotLeaseRequest) -> str:
        """Return why an edge may not have robots in its run; empty when it may."""
        if request.edge not in self._trusted:
            return f"fleet.yaml of {self._edge} does not let {request.edge} coordinate its robots (partners)"
        if not request.begins:
            held = self._leases.robots(request.edge, request.run)
            added = sorted(request.robots.keys() - held)
            if added and held:
                return f"a renewal cannot add {', '.join(added)}: their policy was not asked"
            return "the lease has lapsed" if added else ""
        transport = Transport.CLOUD if request.transport == Transport.CLOUD else Transport.BUS
        origin = Origin(transport, request.source_type, request.session_id)
        for robot in request.robots:
            if robot not in self._robots:
                return f"{self._edge} has no robot {robot!r}"
            refusal = self._policies[robot].mission_refusal(origin, commands=True, navigates=True)
            if refusal is not None:
                return f"{robot}: {refusal}"
        return ""

    def _secure(self, lapsed: ExpiredLease) -> None:
        """Make a robot safe whose coordinator is silent; one that has left the run is not touched."""
        robot = self._robots.get(lapsed.robot)
        if robot is None:  # it was removed from this edge meanwhile
            return
        state = robot.state()
        if state.run != lapsed.run:
            return
        why = f"edge {lapsed.edge}, which coordinates run {lapsed.run}, is silent"
        event = EventReport(self._clock.time(), EventKind.STOP, f"{why}: {lapsed.do}", Severity.ERROR)
        self._record(lapsed.robot, event)
        log.error("%s: %s: %s", lapsed.robot, why, lapsed.do)
        if lapsed.do == "hold" and state.activity not in COMES_DOWN:
            self._request(robot, "stop", lapsed)
            return
        self._request(robot, LEAVE, lapsed)  # only its run may move it
        if lapsed.do != "hold":  # else it is landing already, which only makes it safer
            self._request(robot, lapsed.do, lapsed)

    def _request(self, robot: RunPort, command: str, lapsed: ExpiredLease) -> None:
        """Command a robot in the name of this edge; if it refuses, stop it."""

        def answered(reply: Reply) -> None:
            if command not in ("stop", LEAVE) and (not reply.ok or reply.done is False):
                self._soon(partial(self._request, robot, "stop", lapsed))

        data = {"run": lapsed.run} if command == LEAVE else {}
        message = {"command": command, "data": data, "session_id": f"lease of {lapsed.edge}"}
        request = robot.read("command", msgspec.json.encode(message), transport=Transport.MISSION, waits=True)
        if request is not None:
            request(answered)
