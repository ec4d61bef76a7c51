"""Writes into the history what is asked of one robot, by whom, and how it ended.

A velocity, or where joints are to go, is asked many times a second: the first of a row of them is written,
and how the row ended. What is refused again and again is counted, and the number told with the next refusal
that is written.

What is asked of a robot, a stop above all, does not depend on being written: a failure here is logged.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable
from functools import partial, wraps
from typing import ParamSpec

import msgspec

from fleet.clock import Clock
from fleet.host.requests.decode import Ask, is_stop
from fleet.host.requests.event_reporter import request_of, requester_of
from fleet.host.requests.receipt import Receipt
from fleet.host.requests.stop_cause import StopCause
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Command, JointSetpoint, Origin, Reply, Setpoint
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.navigation import Navigate
from fleet.wire.stops import EMERGENCY

REFUSALS, WINDOW = 20, 60.0  # refusals of a robot that are written in so many seconds
ROW_ENDS = 3.0  # s without a velocity after which the next one begins another row
REFUSED_EVERY = 5.0  # s between refused velocities that are written
REMEMBERED = 256  # requests, to know a repeat

log = logging.getLogger(__name__)
_Given = ParamSpec("_Given")


def never_raises(write: Callable[_Given, None]) -> Callable[_Given, None]:
    """Return what writes as ``write`` does, and logs its failure."""

    @wraps(write)
    def guarded(*given: _Given.args, **named: _Given.kwargs) -> None:
        try:
            write(*given, **named)
        except Exception:
            log.exception("what happened could not be written into the history")

    return guarded


class HistoryRecorder:
    """One robot's part of the history; ``put`` takes events from any thread and never blocks."""

    def __init__(self, put: Callable[[EventReport], None], clock: Clock) -> None:
        self._put = put
        self._clock = clock
        self._driver: Requester | None = None
        self._drove_at = self._not_driven_at = float("-inf")
        self._window, self._refused, self._untold = float("-inf"), 0, 0
        self._known: OrderedDict[str, bool] = OrderedDict()  # requests, with whether their sender was proven

    @never_raises
    def asked(self, ask: Ask, receipt: Receipt) -> None:
        """Write an ask and what is answered to it; on the loop, before it is taken."""
        if isinstance(ask, Setpoint | JointSetpoint):
            receipt.watch(partial(self._drove, ask))
            return
        if is_stop(ask):
            if ask.name != EMERGENCY:  # which is written where it is read
                self._add(
                    EventKind.STOP, f"{_name(ask)} asked", ask, severity=Severity.WARNING, data=_data(ask)
                )
        elif self._is_repeat(request_of(ask)):
            receipt.watch(partial(self._repeated, ask, receipt))
            return
        receipt.watch(partial(self._answered, ask, receipt))

    @never_raises
    def emergency(self, origin: Origin, request: str = "") -> None:
        """Write an emergency stop that a message asked for; from any thread."""
        self.stopped(StopCause(requester_of(origin), request=request))

    @never_raises
    def stopped(self, cause: StopCause) -> None:
        """Write an emergency stop, once for each request: it may come by more than one way. Any thread."""
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
        """Write how an emergency stop ended that no message at this robot asked for."""
        ask = Command(EMERGENCY, id=cause.request)
        receipt.watch(partial(self._answered, ask, receipt, asker=cause.asker))

    @never_raises
    def unread(self, kind: str, origin: Origin, receipt: Receipt) -> None:
        """Write that a message could not be read; its ``receipt`` is refused next."""
        receipt.watch(partial(self._answered, Command(receipt.command or kind, origin=origin), receipt))

    @never_raises
    def lease_ran_out(self) -> None:
        """Write that the velocities ended without a stop."""
        driver, self._driver = self._driver, None
        if driver is not None:
            text = "no velocity within its lease: stopped"
            self._put(
                EventReport(self._clock.time(), EventKind.OUTCOME, text, Severity.WARNING, driver, "move")
            )

    @never_raises
    def _answered(self, ask: Ask, receipt: Receipt, reply: Reply, asker: Requester | None = None) -> None:
        """Write the receipt of an ask, and its end; one answer may be both."""
        if reply is receipt.first:
            self._received(ask, reply, asker)
        if reply.done is not None and (receipt.first is None or receipt.first.ok):
            text = f"{_name(ask)} " + ("done" if reply.done else f"failed: {reply.reason}")
            severity = Severity.INFO if reply.done else Severity.WARNING
            self._add(EventKind.OUTCOME, text, ask, severity=severity, asker=asker)

    def _received(self, ask: Ask, reply: Reply, asker: Requester | None) -> None:
        """Write what was answered first."""
        name = _name(ask)
        if reply.ok and name == RELEASE:
            self._add(EventKind.RELEASE, "the emergency stop was released", ask, severity=Severity.WARNING)
        elif reply.ok and not is_stop(ask):
            self._add(EventKind.COMMAND, f"{name} accepted", ask, data=_data(ask))
        elif not reply.ok and is_stop(ask):
            text = f"{name} {reply.outcome}"
            self._add(EventKind.OUTCOME, text, ask, severity=Severity.CRITICAL, asker=asker)
        elif not reply.ok and self._is_told():
            data = _data(ask) | ({"untold": self._untold} if self._untold else {})
            self._untold = 0
            text = f"{name} {reply.outcome}"
            self._add(EventKind.COMMAND, text, ask, severity=Severity.WARNING, data=data)

    @never_raises
    def _repeated(self, ask: Ask, receipt: Receipt, reply: Reply) -> None:
        """Write that the same was asked again; it is not done twice."""
        if reply is receipt.first and self._is_told():
            text = f"{_name(ask)} asked again: the first answer was given again"
            self._add(EventKind.COMMAND, text, ask, data={"repeat": True})

    @never_raises
    def _drove(self, ask: Setpoint | JointSetpoint, reply: Reply) -> None:
        """Write the first velocity of a row, and now and then one that is refused."""
        now, asker = self._clock.monotonic(), requester_of(ask.origin)
        if reply.ok:
            if asker != self._driver or now - self._drove_at > ROW_ENDS:
                self._add(EventKind.COMMAND, f"{ask.name}: begins to drive", ask, data=_data(ask))
            self._driver, self._drove_at = asker, now
        elif reply.done is None and now - self._not_driven_at > REFUSED_EVERY:
            self._not_driven_at = now
            text = f"{ask.name} {reply.outcome}"
            self._add(EventKind.COMMAND, text, ask, severity=Severity.WARNING, data=_data(ask))

    def _add(
        self,
        kind: EventKind,
        text: str,
        ask: Ask,
        *,
        severity: Severity = Severity.INFO,
        asker: Requester | None = None,
        data: dict[str, object] | None = None,
    ) -> None:
        """Write one event about an ask."""
        now, who = self._clock.time(), asker or requester_of(ask.origin)
        self._put(EventReport(now, kind, text, severity, who, _name(ask), request_of(ask), data or {}))

    def _is_repeat(self, request: str) -> bool:
        """Return whether this was asked before, and remember it."""
        if not request:
            return False
        known = request in self._known
        self._remember(request, proven=False)
        return known

    def _remember(self, request: str, *, proven: bool) -> None:
        """Remember a request."""
        self._known[request] = proven
        if len(self._known) > REMEMBERED:
            self._known.popitem(last=False)

    def _is_told(self) -> bool:
        """Return whether one more refusal is written; else it is counted."""
        now = self._clock.monotonic()
        if now - self._window > WINDOW:
            self._window, self._refused = now, 0
        self._refused += 1
        self._untold += self._refused > REFUSALS
        return self._refused <= REFUSALS


def _name(ask: Ask) -> str:
    """Return what an ask is called: a control of an action by its own word."""
    if isinstance(ask, Navigate) and isinstance(ask.ask, str):
        return f"{ask.name} {ask.ask}"
    return ask.name


def _data(ask: Ask) -> dict[str, object]:
    """Return what was asked, in plain JSON values."""
    if isinstance(ask, JointSetpoint):
        return {"positions": dict(ask.positions), **({"relative": True} if ask.relative else {})}
    if isinstance(ask, Command):
        return {**ask.data, "flaw": ask.flaw} if ask.flaw else dict(ask.data)
    what = ask.velocity if isinstance(ask, Setpoint) else ask.ask
    plain = msgspec.to_builtins(what)
    return plain if isinstance(plain, dict) else {}
