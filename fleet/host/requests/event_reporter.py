"""Reports the events of one robot: in its log, which ``driverlog`` repeats, and as event reports.

An event names the command that caused it and that command's sender, if there is one.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeVar

import msgspec

from fleet.clock import Clock
from fleet.host.requests.decode import RobotRequest
from fleet.model.command import Command, Origin, Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.navigation import Navigate
from fleet.model.report import Report, TelemetryReport
from fleet.runtime.exception_barrier import log_exceptions

log = logging.getLogger(__name__)

ROBOT_LOGGER = "fleet.robot."
"""Prefix of the robots' logger names; their warnings are repeated on ``driverlog``."""
JUST_NOW = 1.0  # s after the end of motion for which an event is still attributed to its request
LEVELS = MappingProxyType(
    {
        Severity.INFO: logging.INFO,
        Severity.WARNING: logging.WARNING,
        Severity.ERROR: logging.ERROR,
        Severity.CRITICAL: logging.CRITICAL,
    }
)

_OURS = frozenset({Transport.MISSION, Transport.LOCAL})  # no message from outside can claim these
RobotRequestT = TypeVar("RobotRequestT", bound=RobotRequest)


def robot_log(name: str) -> logging.Logger:
    """Return the logger of a robot."""
    return logging.getLogger(f"{ROBOT_LOGGER}{name}")


def requester_of(origin: Origin) -> Requester:
    """Return the sender as stated by the message; a sender on this computer is proven."""
    proven = origin.proven or origin.transport in _OURS
    return Requester(origin.transport, origin.session, origin.source_type, proven=proven)


def with_proof(request: RobotRequestT, name: str) -> RobotRequestT:
    """Return a request with a proven sender; ``name`` replaces the sender's name, empty keeps it."""
    known = msgspec.structs.replace(request.origin, session=name or request.origin.session, proven=True)
    return msgspec.structs.replace(request, origin=known)


class EventReporter:
    """Event reporter of one robot. ``in_motion`` returns whether this edge moves it, or may do so.

    Motion and stops do not depend on it: what ``publish`` or ``heard`` raise is logged.
    """

    def __init__(
        self,
        name: str,
        publish: Callable[[Report], None],
        clock: Clock,
        *,
        in_motion: Callable[[], bool],
    ) -> None:
        self.log = robot_log(name)
        self._publish = log_exceptions(log, f"an event of {name} could not be reported")(publish)
        self._clock = clock
        self._in_motion = in_motion
        self._request: RobotRequest | None = None  # request for which it moves, or moved last
        self._ended = float("-inf")
        self.heard: Callable[[str], None] = lambda _why: None  # when anything moves or stops it

    def _hear(self, why: str) -> None:
        """Pass on that something moves or stops the robot."""
        try:
            self.heard(why)
        except Exception:
            log.exception("motion or a stop of a robot could not be passed on")

    def moves(self, request: RobotRequest) -> None:
        """Record the request for which the robot moves from now on."""
        self._request = request
        self._hear(f"{request.name} by {request.origin.session or request.origin.transport}")

    def stops(self, request: Command) -> None:
        """Record a request to stop."""
        self._hear(f"{request.name} by {request.origin.session or request.origin.transport}")

    def ended(self) -> None:
        """Record the end of its motion; events that follow still name the request for which it moved."""
        self._hear("its motion was ended")
        if self._in_motion():
            self._ended = self._clock.monotonic()

    def _moved_by(self) -> RobotRequest | None:
        """Return the request for which the robot moves, or moved until just now."""
        recent = self._clock.monotonic() - self._ended <= JUST_NOW
        return self._request if recent or self._in_motion() else None

    def authority_lost(self, reason: str) -> None:
        """Report that another party took control of the robot."""
        kind = EventKind.AUTHORITY_LOST
        self._hear(f"authority lost: {reason}")
        self.event(kind, f"authority lost: {reason}", telemetry="authority_lost", data={"reason": reason})

    def emergency_stop(self, request: Command, who: str) -> None:
        """Report that an emergency stop was set."""
        text = f"the emergency stop was set, {who}"
        self.event(EventKind.EMERGENCY_STOP, text, severity=Severity.CRITICAL, request=request)

    def event(
        self,
        kind: EventKind,
        text: str,
        *,
        severity: Severity = Severity.WARNING,
        request: RobotRequest | None = None,
        telemetry: str = "",
        data: Mapping[str, object] = MappingProxyType({}),
        logs: bool = True,
    ) -> None:
        """Report an event; ``request`` is its cause, by default the request for which the robot moves.

        With ``telemetry``, a message of this type and the same ``data`` is published on the telemetry
        channel. ``logs``: write it to the log, where it is not yet.
        """
        if logs:
            self.log.log(LEVELS[severity], "%s", text)
        request = request or self._moved_by()
        self._publish(
            EventReport(
                self._clock.time(),
                kind,
                text,
                severity,
                requester_of(request.origin) if request is not None else None,
                request.name if request is not None else "",
                request_of(request),
                dict(data),
            )
        )
        if telemetry:
            self._publish(TelemetryReport(self._clock.time(), telemetry, dict(data)))


def request_of(request: RobotRequest | None) -> str:
    """Return the id of a request, empty if it has none."""
    match request:
        case Command():
            return request.id
        case Navigate():
            return request.action_id
        case _:
            return ""
