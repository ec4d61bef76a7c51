"""Robots of other edges in runs of this edge: their states, and the lease of each run.

They are commanded over the bus keys that any program uses, with the identities of the run's parts. Before one
joins a run, its edge grants a lease (``fleet.missions.coordination``), which is renewed until the robot is
released.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import msgspec

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import Clock
from fleet.config.other_edges import PartnerConfig
from fleet.errors import WireError
from fleet.host.runtime.threads import HALT_WAIT, run_in_thread
from fleet.host.safety.admission import JOIN, LEAVE
from fleet.host.workers.remote_robot import SILENT_AFTER, request_robot
from fleet.missions.coordination import RENEWED_EVERY, LeaseAnswer, RobotLeaseRequest
from fleet.missions.program import Do
from fleet.missions.run import Run
from fleet.missions.state import instruction_of
from fleet.model.command import Answer, Reply, ReplyStatus, Request, Transport
from fleet.model.state import RobotState
from fleet.runtime.decoding import decode_json
from fleet.wire.rules import Kind
from fleet.wire.strict_json import parse_object

log = logging.getLogger(__name__)

GRANTED_WITHIN = 3.0  # s


class PartnerRobot:
    """A robot of another edge, as a run uses it."""

    def __init__(self, name: str, edge: str, partners: Partners, clock: Clock) -> None:
        self.name = name
        self.edge = edge
        self.placed = False  # its site is ours, so that places mean the same
        self._partners = partners
        self._clock = clock
        self._state = RobotState(name, "", "", edge, 0.0, cause=f"edge {edge} does not answer")
        self._heard = self._joined_at = float("-inf")
        self._joined = self._left_before = ""

    def state(self) -> RobotState:
        """Return its edge's last state of it; without its position unless that is in our frame."""
        state = self._state
        if not self.placed:
            state = msgspec.structs.replace(state, site=None, placement=None)
        joining = self._clock.monotonic() - self._joined_at <= SILENT_AFTER
        if joining and not state.run and state.left_run == self._left_before:  # sent before it joined
            state = msgspec.structs.replace(state, run=self._joined)
        if self._clock.monotonic() - self._heard <= SILENT_AFTER:
            return state
        return msgspec.structs.replace(
            state, health="offline", cause=f"edge {self.edge} does not answer", reachable=False
        )

    def joined(self, run: str) -> None:
        """Record that it has joined a run: the state of its edge follows within about a second."""
        self._joined, self._joined_at = run, self._clock.monotonic()
        self._left_before = self._state.left_run

    def arrived(self, payload: bytes) -> None:
        """Process a state; on the bus's thread."""
        try:
            state = decode_json(payload, RobotState)
        except msgspec.DecodeError as error:
            log.warning("%s: a state that cannot be read: %s", self.name, error)
            return
        if (state.name, state.edge) == (self.name, self.edge):
            self._state, self._heard = state, self._clock.monotonic()

    def read(
        self, kind: Kind, payload: bytes, *, transport: Transport, request_id: str = "", waits: bool = False
    ) -> Request | None:
        """Decode a message of a run; the returned request sends it, with a lease if the robot joins by it."""
        parameters = {"kind": kind, "way": transport.value} | ({"wait": "1"} if waits else {})
        if request_id:
            parameters["id"] = request_id
        send = partial(self._partners.send, self, payload, parameters)
        return Request(partial(self._partners.relay, self, payload, transport, send))


class Partners:
    """Robots of other edges that missions of this edge may use, and the leases of its runs."""

    def __init__(
        self,
        edge: str,
        partners: Mapping[str, PartnerConfig],
        control: ZenohSession,
        *,
        site: tuple[float, float, float] | None,
        soon: Callable[[Callable[[], None]], None],
        clock: Clock,
    ) -> None:
        self._edge, self._control, self._site, self._soon = edge, control, site, soon
        self.robots = {
            robot: PartnerRobot(robot, name, self, clock)
            for name, partner in partners.items()
            for robot in partner.robots
        }
        self._held: dict[tuple[str, str], set[str]] = {}  # robots by run and edge
        self.runs: Callable[[], Iterable[Run]] = tuple

    def edge_of(self, robot: str) -> str:
        """Return the other edge that has a robot; empty for one of this edge."""
        found = self.robots.get(robot)
        return found.edge if found is not None else ""

    def declare(self, every: Callable[[float, Callable[[], None]], object]) -> None:
        """Subscribe to the robots' states, and renew leases periodically."""
        for edge in {robot.edge for robot in self.robots.values()}:
            calls = {
                keys.state(edge, robot.name): robot.arrived
                for robot in self.robots.values()
                if robot.edge == edge
            }
            self._control.subscribe_many(keys.state(edge, "*"), calls)
        if self.robots:
            every(RENEWED_EVERY, self.renew)

    def stop(self, names: Iterable[str]) -> tuple[str, ...]:
        """Set the emergency stop of the partners' robots among them; return the others.

        On other threads: a congested session must not delay the stops of our own robots.
        """
        ours = []
        for name in names:
            robot = self.robots.get(name)
            if robot is None:
                ours.append(name)
            else:
                run_in_thread(partial(self._put_stop, robot), wait=HALT_WAIT)
        return tuple(ours)

    def _put_stop(self, robot: PartnerRobot) -> None:
        """Send one stop; waits while the session is congested. Never raises."""
        try:
            self._control.put(keys.stop(robot.edge), msgspec.json.encode([robot.name]), urgent=True)
        except Exception:
            log.exception("the emergency stop of %s was not sent", robot.name)

    def renew(self) -> None:
        """Renew the leases of the runs in progress; on the event loop."""
        runs = {run.id: run for run in self.runs()}
        for (run, edge), robots in list(self._held.items()):
            kept = robots if run in runs else set()
            if not kept:
                del self._held[run, edge]
            request = RobotLeaseRequest(run, self._edge, dict.fromkeys(kept, _failed_do(runs.get(run))))
            self._request(edge, request, lambda _answer: None)

    def relay(
        self,
        robot: PartnerRobot,
        payload: bytes,
        transport: Transport,
        send: Callable[[Answer], None],
        answer: Answer,
    ) -> None:
        """Send a message; a robot joins with a lease, and leaves without one. On the event loop."""
        try:
            message = parse_object(payload)
        except WireError as error:
            answer(Reply("", ReplyStatus.REJECTED, str(error)))
            return
        name, data = message.get("command"), message.get("data")
        run = str(data.get("run", "")) if isinstance(data, dict) else ""
        if name == JOIN:
            self._join(robot, run, message, transport, send, answer)
            return
        if name == LEAVE:
            self._held.get((run, robot.edge), set()).discard(robot.name)
        send(answer)

    def _join(  # noqa: PLR0917 - by position
        self,
        robot: PartnerRobot,
        run: str,
        message: dict[str, Any],
        transport: Transport,
        send: Callable[[Answer], None],
        answer: Answer,
    ) -> None:
        """Make a robot join a run once its edge has granted the lease."""
        robots = {*self._held.get((run, robot.edge), ()), robot.name}
        request = RobotLeaseRequest(
            run,
            self._edge,
            dict.fromkeys(robots, "hold"),
            begins=True,
            transport=transport.value,
            source_type=message.get("source_type"),
            session_id=str(message.get("session_id", "")),
        )
        self._held[run, robot.edge] = robots

        def joined(reply: Reply) -> None:
            if reply.ok:
                robot.joined(run)
            answer(reply)

        def granted(said: LeaseAnswer) -> None:
            robot.placed = self._site is not None and said.site == self._site
            if said.refusal:
                self._held.get((run, robot.edge), set()).discard(robot.name)
                answer(Reply(JOIN, ReplyStatus.REJECTED, said.refusal))
            else:
                send(joined)

        self._request(robot.edge, request, granted)

    def send(
        self, robot: PartnerRobot, payload: bytes, parameters: Mapping[str, str], answer: Answer
    ) -> None:
        """Send a message to a robot; its replies come back on the event loop."""
        request_robot(
            self._control,
            keys.command(robot.edge, robot.name),
            payload,
            parameters,
            name="command",
            answer=lambda reply: self._soon(partial(answer, reply)),
            silent=f"edge {robot.edge}",
        )

    def _request(
        self, edge: str, request: RobotLeaseRequest, on_answer: Callable[[LeaseAnswer], None]
    ) -> None:
        """Request a lease; ``on_answer`` gets the answer, on the event loop."""
        found: list[LeaseAnswer] = []

        def answered(data: bytes) -> None:
            found.append(decode_json(data, LeaseAnswer))

        def ended() -> None:
            silent = LeaseAnswer(f"edge {edge} does not let {self._edge} coordinate its robots, or is silent")
            self._soon(partial(on_answer, found[0] if found else silent))

        self._control.request_later(
            keys.coordinator(edge),
            msgspec.json.encode(request),
            timeout=GRANTED_WITHIN,
            on_answer=answered,
            on_end=ended,
        )


def _failed_do(run: Run | None) -> str:
    """Return what a robot does that fails in the present step."""
    step = instruction_of(run.engine.program, run.engine.head) if run is not None else None
    return step.failed_do if isinstance(step, Do) else "hold"
