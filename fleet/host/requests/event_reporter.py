"""Tells what happened to one robot: in its log, which its ``driverlog`` repeats, and as an event.

An event names the command that led to it, and who asked for that, where there is one.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeVar

import msgspec

from fleet.clock import Clock
from fleet.model.command import Command, JointSetpoint, Origin, Setpoint, Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.navigation import Navigate
from fleet.model.report import Report, TelemetryReport

ROBOT_LOGGER = "fleet.robot."
"""What the names of the robots' loggers begin with; their warnings are repeated on ``driverlog``."""
JUST_NOW = 1.0  # s
LEVELS = MappingProxyType(
    {
        Severity.INFO: logging.INFO,
        Severity.WARNING: logging.WARNING,
        Severity.ERROR: logging.ERROR,
        Severity.CRITICAL: logging.CRITICAL,
    }
)

_OURS = frozenset({Transport.MISSION, Transport.LOCAL})  # which no message from outside can claim
Ask = Command | Setpoint | JointSetpoint | Navigate
AnyAsk = TypeVar("AnyAsk", bound=Ask)


def robot_log(name: str) -> logging.Logger:
    """Return the logger of a robot."""
    return logging.getLogger(f"{ROBOT_LOGGER}{name}")


def requester_of(origin: Origin) -> Requester:
    """Return who asked, as far as the message itself says; who is on this computer is known for sure."""
    proven = origin.proven or origin.way in _OURS
    return Requester(origin.way, origin.session, origin.source_type, proven=proven)


def with_proof(ask: AnyAsk, name: str) -> AnyAsk:
    """Return a request whose sender's name is known to be true; empty: the one that the request has."""
    known = msgspec.structs.replace(ask.origin, session=name or ask.origin.session, proven=True)
    return msgspec.structs.replace(ask, origin=known)


class EventReporter:
    """What one robot has to tell. ``in_motion`` tells whether it moves, or may move, because of us."""

    def __init__(
        self,
        name: str,
        publish: Callable[[Report], None],
        clock: Clock,
        *,
        in_motion: Callable[[], bool],
    ) -> None:
        self.log = robot_log(name)
        self._publish = publish
        self._clock = clock
        self._in_motion = in_motion
        self._ask: Ask | None = None  # for which it moves, or moved last
        self._ended = float("-inf")
        self.heard: Callable[[str], None] = lambda _why: None  # of what else moves, stops or ends it

    def moves(self, ask: Ask) -> None:
        """Note for which ask the robot moves from now on."""
        self._ask = ask
        self.heard(f"{ask.name} by {ask.origin.session or ask.origin.way}")

    def stops(self, ask: Command) -> None:
        """Note that the robot is asked to stop."""
        self.heard(f"{ask.name} by {ask.origin.session or ask.origin.way}")

    def ended(self) -> None:
        """Note that its motion is ended now: what is told of that names what it moved for."""
        self.heard("its motion was ended")
        if self._in_motion():
            self._ended = self._clock.monotonic()

    def _moved_by(self) -> Ask | None:
        """Return the ask for which the robot moves, or did so just now."""
        recent = self._clock.monotonic() - self._ended <= JUST_NOW
        return self._ask if recent or self._in_motion() else None

    def authority_lost(self, reason: str) -> None:
        """Tell that somebody else took the robot."""
        kind = EventKind.AUTHORITY_LOST
        self.heard(f"authority lost: {reason}")
        self.event(kind, f"authority lost: {reason}", telemetry="authority_lost", data={"reason": reason})

    def emergency_stop(self, ask: Command, who: str) -> None:
        """Tell that an emergency stop was set."""
        text = f"the emergency stop was set, {who}"
        self.event(EventKind.EMERGENCY_STOP, text, severity=Severity.CRITICAL, ask=ask)

    def event(
        self,
        kind: EventKind,
        text: str,
        *,
        severity: Severity = Severity.WARNING,
        ask: Ask | None = None,
        telemetry: str = "",
        data: Mapping[str, object] = MappingProxyType({}),
        logs: bool = True,
    ) -> None:
        """Tell an event; ``ask`` led to it, left out where that is what the robot moves for.

        ``telemetry`` is the type of a message on that channel with the same ``data``, where one is told too.
        ``logs``: it is not in the log yet.
        """
        if logs:
            self.log.log(LEVELS[severity], "%s", text)
        ask = ask or self._moved_by()
        self._publish(
            EventReport(
                self._clock.time(),
                kind,
                text,
                severity,
                requester_of(ask.origin) if ask is not None else None,
                ask.name if ask is not None else "",
                request_of(ask),
                dict(data),
            )
        )
        if telemetry:
            self._publish(TelemetryReport(self._clock.time(), telemetry, dict(data)))


def request_of(ask: Ask | None) -> str:
    """Return the id of what was asked, empty for what has none."""
    if isinstance(ask, Navigate):
        return ask.action_id
    return ask.id if isinstance(ask, Command) else ""
