"""Events of a robot or an edge: what happened, who requested it, and how severe it is.

The same form serves the edge's history, the cloud's ``event`` topic and ``notify``.
"""

from __future__ import annotations

import enum
from typing import Any, ClassVar

import msgspec

from fleet.model.command import Transport


class Severity(enum.StrEnum):
    """Severity of an event; the words are those of the log levels."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    CRITICAL = "critical"


class EventKind(enum.StrEnum):
    """Kind of an event, as written to the history and, for events sent to the cloud, to ``event_type``."""

    COMMAND = "command"  # a request was admitted or refused
    OUTCOME = "outcome"  # final result of a request
    STOP = "stop"  # motion was stopped on request
    EMERGENCY_STOP = "emergency_stop"  # an emergency stop was set
    RELEASE = "release"  # an emergency stop was released
    AUTHORITY_LOST = "authority_lost"  # another operator took control of the robot
    HEALTH = "health"  # the health level changed
    FOUND = "found"  # the robot answers
    LOST = "lost"  # the robot no longer answers
    FAILSAFE = "failsafe"  # the robot runs a failsafe of its own
    FENCE = "fence_breached"  # the robot is outside its fence
    BATTERY = "battery"  # the battery policy acted
    SEPARATION = "separation"  # another robot is too near
    SCHEDULE = "schedule"  # a schedule fired, was skipped, or was switched
    LOGIN = "login"  # a login at the console, or a failed attempt


class Requester(msgspec.Struct, frozen=True, omit_defaults=True):
    """Sender of a request, and whether its name is authenticated.

    ``proven``: the transport vouches for ``name`` (a certificate, the user of a local socket). Otherwise the
    name is only what the message claims.
    """

    transport: Transport = msgspec.field(name="way")  # as in files and messages of all versions
    name: str = ""
    source_type: str | None = None
    proven: bool = False


class EventReport(msgspec.Struct, frozen=True, omit_defaults=True):
    """One event. ``stamp`` is Unix seconds; ``text`` is a sentence for the user.

    ``request`` is the id of the command that led to the event, ``command`` its name, ``asker`` its sender;
    empty if no command did. ``data`` holds plain JSON values.
    """

    channel: ClassVar[str] = "event"
    stamp: float
    kind: EventKind
    text: str
    severity: Severity = Severity.INFO
    asker: Requester | None = None
    command: str = ""
    request: str = ""
    data: dict[str, Any] = {}
