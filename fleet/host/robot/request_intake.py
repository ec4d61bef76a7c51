"""Intake of the requests to one robot: decoded on any thread, executed by its controller on the loop."""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Callable
from functools import partial

from fleet.clock import Clock
from fleet.errors import WireError
from fleet.host.requests.decode import (
    RequestDecoder,
    RobotRequest,
    is_discrete,
    is_stop,
    max_wait,
    reply_with_flaw,
)
from fleet.host.requests.event_reporter import request_of, requester_of, robot_log, with_proof
from fleet.host.requests.history_recorder import HistoryRecorder
from fleet.host.requests.receipt import Receipt
from fleet.host.requests.stop_cause import StopCause
from fleet.host.robot.controller import RobotController
from fleet.host.robot.distance_moves import goal_of
from fleet.model.command import Answer, Command, Origin, Reply, Request, Transport
from fleet.model.navigation import ActionState
from fleet.model.report import NavigationReport
from fleet.robot_config import AdapterConfig
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.rules import Kind
from fleet.wire.stops import EMERGENCY


class RequestIntake:
    """Decodes requests, passes them to the robot's controller and records them in the history.

    ``changed`` is called with the robot's name when its state is to be published. ``arrival`` returns since
    when (monotonic s) a message may have waited for the loop, ``home_altitude`` that of the robot's home, if
    known. ``context`` is the context that the controller runs in. ``in_use``: the robot was moved through
    this edge, and no other edge has taken it since.
    """

    def __init__(
        self,
        config: AdapterConfig,
        controller: RobotController,
        *,
        clock: Clock,
        publish: Callable[[NavigationReport], None],
        changed: Callable[[str], None],
        recorder: HistoryRecorder,
        arrival: Callable[[], float],
        home_altitude: Callable[[], float | None],
        context: contextvars.Context,
    ) -> None:
        self._config = config
        self._controller = controller
        self._clock = clock
        self._publish = publish
        self._changed = changed
        self._recorder = recorder
        self._arrival = arrival
        self._context = context
        self._loop = asyncio.get_running_loop()
        self._log = robot_log(config.name)
        self._refusals = RateLimitedCounter(self._log, clock)
        self._decoder = RequestDecoder(
            config,
            controller.speeds.of,
            planar=controller.can.limits.vertical_speed is None,
            home_altitude=home_altitude,
        )
        self.in_use = False

    def configure(self, config: AdapterConfig) -> None:
        """Use the age limits of another configuration."""
        self._config = config

    def read(
        self,
        kind: Kind,
        payload: bytes,
        *,
        transport: Transport,
        request_id: str = "",
        waits: bool = False,
        unread: str = "",
        proven: str | None = None,
    ) -> Request | None:
        """Decode a message, on any thread; an emergency stop is latched and halts the robot at once.

        The returned request is called on the loop with a function that takes the answers: the receipt, and
        with ``waits`` the outcome. A request that waited too long for a blocked loop is refused. Returns None
        for a reply. ``unread``: why the payload must not be decoded; ``proven``: the sender's authenticated
        name, empty if the name in the message is authentic.
        """
        arrived = self._arrival()
        try:
            request = self.decode_request(
                kind, payload, transport=transport, request_id=request_id, unread=unread
            )
        except WireError as error:
            name, action_id = getattr(error, "command", "") or kind, getattr(error, "action_id", "")
            return Request(partial(self._refuse, kind, transport, name, action_id, str(error)))
        if request is None:
            return None
        request = request if proven is None else with_proof(request, proven)
        if request.name == EMERGENCY:
            self._stop_at_once(request.origin, request_of(request))
        return Request(
            partial(self.submit, kind, request, waits, arrived), is_stop(request), is_discrete(request)
        )

    def decode_request(
        self, kind: Kind, payload: bytes, *, transport: Transport, request_id: str, unread: str = ""
    ) -> RobotRequest | None:
        """Decode the request in a message, None for a reply; raises WireError."""
        request = self._decoder.decode(
            kind, payload, transport=transport, request_id=request_id, unread=unread
        )
        return goal_of(request, self._controller.can, self._controller.speeds.of)

    def submit(self, kind: Kind, request: RobotRequest, waits: bool, arrived: float, answer: Answer) -> None:  # noqa: FBT001 - by position
        """Pass a request to the controller, or refuse it if it has waited too long since ``arrived``."""
        if isinstance(request, Command) and request.flaw:
            line = "took a message that was refused for %s: %s"
            self._refusals.add("flawed", line, request.name, request.flaw)
            answer = reply_with_flaw(answer, request.flaw)
        receipt = Receipt(request.name, answer, waits=waits)
        waited = self._clock.monotonic() - arrived
        if waited <= max_wait(request, self._config):
            self.begin(request, receipt)
            return
        self._recorder.requested(request, receipt)
        why = f"it waited up to {waited:.1f} s: the edge was held up"
        self._refusals.add("late", "refused %s: %s", request.name, why)
        receipt.reject(why)
        self._report_failed(kind, getattr(request, "action_id", ""), why)

    def begin(self, request: RobotRequest, receipt: Receipt) -> None:
        """Record a request, and pass it to the controller; on the loop."""
        self._recorder.requested(request, receipt)
        self._context.run(self._controller.receive, request, receipt)
        self.in_use = self.in_use or self._controller.motion.in_control

    def log_refusal(self, reply: Reply) -> None:
        """Log the refusal of a setpoint that was published on the bus, which has no answer."""
        if not reply.ok:
            self._refusals.add("setpoint", "refused a setpoint of the bus: %s", reply.reason)

    def follow_emergency(self, cause: StopCause) -> None:
        """Have the adapter stop the robot, on the loop, after an emergency stop was set; from any thread."""
        self._loop.call_soon_threadsafe(self._follow_emergency, cause)
        self._recorder.stopped(cause)

    def _follow_emergency(self, cause: StopCause) -> None:
        """Have the adapter stop the robot; a stop that was released meanwhile is set again."""
        self._controller.latch.engage(cause.sentence)
        requester = cause.asker
        request = Command(
            EMERGENCY,
            origin=Origin(requester.transport, session=requester.name or cause.sentence),
            id=cause.request,
        )
        receipt = Receipt(EMERGENCY, lambda _: None)
        self._recorder.followed(cause, receipt)
        self._controller.receive(request, receipt)
        self._changed(self._controller.name)

    def _refuse(  # noqa: PLR0917 - by position
        self, kind: Kind, transport: Transport, name: str, action_id: str, why: str, answer: Answer
    ) -> None:
        """Refuse a message that cannot be decoded. ``why`` is text: an error would keep the message alive."""
        self._refusals.add(kind, "refused a %s message: %s", kind, why)
        receipt = Receipt(name, answer)
        self._recorder.unread(kind, Origin(transport), receipt)
        receipt.reject(why)
        self._report_failed(kind, action_id, why)

    def _stop_at_once(self, origin: Origin, request: str) -> None:
        """Latch the stop and halt the robot, on any thread; if that fails, the loop still stops the robot."""
        try:
            self._controller.emergency(StopCause(requester_of(origin)).sentence)
        except Exception:  # noqa: BLE001 - logged: the stop that follows on the loop does not depend on it
            self._log.exception("the emergency stop did not go through at once")
        self._recorder.emergency(origin, request)

    def _report_failed(self, kind: Kind, action_id: str, why: str) -> None:
        """Report a refused goal or mission as failed, with its action id if it has one."""
        if kind in ("navigate", "mission"):
            step = 0 if kind == "mission" else None
            self._publish(NavigationReport(self._clock.time(), action_id, ActionState.FAILED, 0.0, why, step))
