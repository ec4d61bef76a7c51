"""Records the requests to one robot in the history, with their senders and outcomes.

Velocities and joint targets arrive many times a second: only the first of a series is recorded, and how the
series ended. Refusals beyond a rate are counted, and the next recorded refusal has their number.

No request, above all no stop, depends on the history: a failure here is only logged.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable
from functools import partial

import msgspec

from fleet.clock import Clock
from fleet.host.requests.decode import RobotRequest, is_stop
from fleet.host.requests.event_reporter import request_of, requester_of
from fleet.host.requests.receipt import Receipt
from fleet.host.requests.stop_cause import StopCause
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Command, JointSetpoint, Origin, Reply, Setpoint
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.navigation import Navigate
from fleet.runtime.exception_barrier import log_exceptions
from fleet.wire.stops import EMERGENCY

REFUSALS, WINDOW = 20, 60.0  # recorded refusals of a robot, per so many seconds
ROW_ENDS = 3.0  # s without a velocity after which the next one begins a new series
REFUSED_EVERY = 5.0  # s between recorded refusals of velocities
REMEMBERED = 256  # request ids kept for the detection of repeats

log = logging.getLogger(__name__)

never_raises = log_exceptions(log, "what happened could not be written into the history")
"""Decorator: what could not be recorded is logged."""


class HistoryRecorder:
    """Recorder of one robot; ``put`` takes events from any thread and never blocks."""

    def __init__(self, put: Callable[[EventReport], None], clock: Clock) -> None:
        self._put = put
        self._clock = clock
        self._driver: Requester | None = None
        self._drove_at = self._not_driven_at = float("-inf")
        self._window, self._refused, self._unrecorded = float("-inf"), 0, 0
        self._known: OrderedDict[str, bool] = OrderedDict()  # request id to: sender proven

    @never_raises
    def requested(self, request: RobotRequest, receipt: Receipt) -> None:
        """Record a request and the replies to it; on the event loop, before it is executed."""
        if isinstance(request, Setpoint | JointSetpoint):
            receipt.watch(partial(self._drove, request))
            return
        if is_stop(request):
            if request.name != EMERGENCY:  # EMERGENCY is recorded where it is decoded
                self._add(
                    EventKind.STOP,
                    f"{_name(request)} asked",
                    request,
                    severity=Severity.WARNING,
                    data=_data(request),
                )
        elif self._is_repeat(request_of(request)):
            receipt.watch(partial(self._repeated, request, receipt))
            return
        receipt.watch(partial(self._answered, request, receipt))

    @never_raises
    def emergency(self, origin: Origin, request: str = "") -> None:
        """Record an emergency stop from a message; from any thread."""
        self.stopped(StopCause(requester_of(origin), request=request))

    @never_raises
    def stopped(self, cause: StopCause) -> None:
        """Record an emergency stop once per request: it may use several transports. From any thread."""
        if cause.request:
            proven = self._known.get(cause.request)
            if proven or (proven is False and not cause.asker.proven):
                return
            self._remember(cause.request, proven=cause.asker.proven)
        text = f"{EMERGENCY} asked" + f": {cause.reason}" * bool(cause.reason)
        data = {"reason": cause.reason} if cause.reason else {}
        now, request = self._clock.time(), cause.request
        self._put(
            EventReport(now, EventKind.STOP, text, Severity.CRITICAL, cause.asker, EMERGENCY, request, data)
        )

    @never_raises
    def followed(self, cause: StopCause, receipt: Receipt) -> None:
        """Record the outcome of an emergency stop that no message to this robot asked for."""
        request = Command(EMERGENCY, id=cause.request)
        receipt.watch(partial(self._answered, request, receipt, requester=cause.asker))

    @never_raises
    def unread(self, kind: str, origin: Origin, receipt: Receipt) -> None:
        """Record a message that could not be decoded; its ``receipt`` is refused next."""
        receipt.watch(partial(self._answered, Command(receipt.command or kind, origin=origin), receipt))

    @never_raises
    def lease_ran_out(self) -> None:
        """Record that a velocity stream ended without a stop."""
        driver, self._driver = self._driver, None
        if driver is not None:
            text = "no velocity within its lease: stopped"
            self._put(
                EventReport(self._clock.time(), EventKind.OUTCOME, text, Severity.WARNING, driver, "move")
            )

    @never_raises
    def _answered(
        self, request: RobotRequest, receipt: Receipt, reply: Reply, requester: Requester | None = None
    ) -> None:
        """Record the receipt of a request and its end; one reply may be both."""
        if reply is receipt.first:
            self._received(request, reply, requester)
        if reply.done is not None and (receipt.first is None or receipt.first.ok):
            text = f"{_name(request)} " + ("done" if reply.done else f"failed: {reply.reason}")
            severity = Severity.INFO if reply.done else Severity.WARNING
            self._add(EventKind.OUTCOME, text, request, severity=severity, requester=requester)

    def _received(self, request: RobotRequest, reply: Reply, requester: Requester | None) -> None:
        """Record the receipt."""
        name = _name(request)
        if reply.ok and name == RELEASE:
            self._add(
                EventKind.RELEASE, "the emergency stop was released", request, severity=Severity.WARNING
            )
        elif reply.ok and not is_stop(request):
            self._add(EventKind.COMMAND, f"{name} accepted", request, data=_data(request))
        elif not reply.ok and is_stop(request):
            text = f"{name} {reply.outcome}"
            self._add(EventKind.OUTCOME, text, request, severity=Severity.CRITICAL, requester=requester)
        elif not reply.ok and self._is_recorded():
            data = _data(request) | ({"untold": self._unrecorded} if self._unrecorded else {})
            self._unrecorded = 0
            text = f"{name} {reply.outcome}"
            self._add(EventKind.COMMAND, text, request, severity=Severity.WARNING, data=data)

    @never_raises
    def _repeated(self, request: RobotRequest, receipt: Receipt, reply: Reply) -> None:
        """Record a repeated request, which is not executed again."""
        if reply is receipt.first and self._is_recorded():
            text = f"{_name(request)} asked again: the first answer was given again"
            self._add(EventKind.COMMAND, text, request, data={"repeat": True})

    @never_raises
    def _drove(self, request: Setpoint | JointSetpoint, reply: Reply) -> None:
        """Record the first velocity of a series, and refused ones at a limited rate."""
        now, requester = self._clock.monotonic(), requester_of(request.origin)
        if reply.ok:
            if requester != self._driver or now - self._drove_at > ROW_ENDS:
                self._add(EventKind.COMMAND, f"{request.name}: begins to drive", request, data=_data(request))
            self._driver, self._drove_at = requester, now
        elif reply.done is None and now - self._not_driven_at > REFUSED_EVERY:
            self._not_driven_at = now
            text = f"{request.name} {reply.outcome}"
            self._add(EventKind.COMMAND, text, request, severity=Severity.WARNING, data=_data(request))

    def _add(
        self,
        kind: EventKind,
        text: str,
        request: RobotRequest,
        *,
        severity: Severity = Severity.INFO,
        requester: Requester | None = None,
        data: dict[str, object] | None = None,
    ) -> None:
        """Put one event about a request into the history."""
        now, who = self._clock.time(), requester or requester_of(request.origin)
        self._put(
            EventReport(now, kind, text, severity, who, _name(request), request_of(request), data or {})
        )

    def _is_repeat(self, request: str) -> bool:
        """Return whether this id was seen before; remember it."""
        if not request:
            return False
        known = request in self._known
        self._remember(request, proven=False)
        return known

    def _remember(self, request: str, *, proven: bool) -> None:
        """Remember a request id, up to ``REMEMBERED`` of them."""
        self._known[request] = proven
        if len(self._known) > REMEMBERED:
            self._known.popitem(last=False)

    def _is_recorded(self) -> bool:
        """Return whether one more refusal is recorded; else count it."""
        now = self._clock.monotonic()
        if now - self._window > WINDOW:
            self._window, self._refused = now, 0
        self._refused += 1
        self._unrecorded += self._refused > REFUSALS
        return self._refused <= REFUSALS


def _name(request: RobotRequest) -> str:
    """Return the name of a request; for an action, with its control word."""
    if isinstance(request, Navigate) and isinstance(request.instruction, str):
        return f"{request.name} {request.instruction}"
    return request.name


def _data(request: RobotRequest) -> dict[str, object]:
    """Return the content of a request as plain JSON values."""
    if isinstance(request, JointSetpoint):
        return {"positions": dict(request.positions), **({"relative": True} if request.relative else {})}
    if isinstance(request, Command):
        return {**request.data, "flaw": request.flaw} if request.flaw else dict(request.data)
    what = request.velocity if isinstance(request, Setpoint) else request.instruction
    plain = msgspec.to_builtins(what)
    return plain if isinstance(plain, dict) else {}
