"""What happened to a robot or an edge, who asked for it, and how grave it is.

One form for all that wants to know: the history of the edge, the cloud's ``event`` topic, ``notify``.
"""

from __future__ import annotations

import enum
from typing import Any, ClassVar

import msgspec

from fleet.model.command import Transport


class Severity(enum.StrEnum):
    """How grave an event is; the words are those of the log levels."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    CRITICAL = "critical"


class EventKind(enum.StrEnum):
    """What happened, as it stands in the history and, where it goes there, in the cloud's ``event_type``."""

    COMMAND = "command"  # something was asked, and admitted or refused
    OUTCOME = "outcome"  # how what was asked ended
    STOP = "stop"  # motion was ended because somebody asked
    EMERGENCY_STOP = "emergency_stop"  # an emergency stop was set
    RELEASE = "release"  # an emergency stop was released
    AUTHORITY_LOST = "authority_lost"  # somebody else took the robot
    HEALTH = "health"  # the level changed
    FOUND = "found"  # the robot answers
    LOST = "lost"  # the robot does not answer
    FAILSAFE = "failsafe"  # the robot acts by itself
    FENCE = "fence_breached"  # it is outside its fence
    BATTERY = "battery"  # its battery made us do something
    SEPARATION = "separation"  # another robot is too near
    SCHEDULE = "schedule"  # a schedule fired, was skipped, or was switched


class Requester(msgspec.Struct, frozen=True, omit_defaults=True):
    """Who asked for something, and how far that is known.

    ``proven``: the way in vouches for the name (a certificate, the user of a local socket); else it is what
    the message claims.
    """

    way: Transport
    name: str = ""
    source_type: str | None = None
    proven: bool = False


class EventReport(msgspec.Struct, frozen=True, omit_defaults=True):
    """One event. ``stamp`` is Unix seconds; ``text`` is a sentence for people.

    ``request`` is the id of the command that led to it, ``command`` its name, ``asker`` who sent that;
    empty where nobody asked. ``data`` holds plain JSON values.
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
