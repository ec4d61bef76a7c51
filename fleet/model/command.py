"""What may be asked of a robot: a command, a setpoint of its velocity or joints, navigation; the answer."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet.model.geometry import Velocity


class Transport(enum.StrEnum):
    """The way by which something was asked."""

    CLOUD = "cloud"  # an MQTT topic of the twin
    BUS = "bus"  # a Zenoh query or a local setpoint
    MISSION = "mission"  # the host's own schedule
    LOCAL = "local"  # this computer: the supervisor's socket, a stop input


class Origin(msgspec.Struct, frozen=True):
    """Who asked, and how.

    ``source_type`` is Cyberwave's word as it was sent, None when it was missing.
    ``session`` names the asker for the control lease and the clock-skew estimate.
    """

    way: Transport
    source_type: str | None = None
    session: str = ""


RUN_SESSION = "run "
"""What the session of a run of a mission begins with."""


def session_of(run: str) -> str:
    """Return the session in which a run of a mission commands its robots."""
    return f"{RUN_SESSION}{run}"


class Command(msgspec.Struct, frozen=True):
    """Something discrete asked of a robot; has exactly one receipt.

    ``id`` is what makes a repeat of it recognisable: the asker's request id, or a digest of a stamped
    message, or empty when it cannot be told from a second press of the same button.
    ``stamp`` is the asker's Unix time, None when it was not given. ``flaw`` is what is wrong with a stop
    that is obeyed all the same, empty for what could be read; the asker is told.
    """

    name: str
    data: Mapping[str, Any] = {}
    origin: Origin = Origin(Transport.BUS)
    id: str = ""
    stamp: float | None = None
    flaw: str = ""


class Setpoint(msgspec.Struct, frozen=True):
    """A velocity to hold now; the newest wins; lives for ``lease`` seconds (None: the default)."""

    velocity: Velocity
    name: str = "move"
    lease: float | None = None
    origin: Origin = Origin(Transport.BUS)
    stamp: float | None = None


class JointSetpoint(msgspec.Struct, frozen=True):
    """Where joints are to go now, by name: rad (or m); the newest wins, and each lives for its lease.

    ``relative``: they count from where the joints are. ``id`` tells a repeat of such a one, which would
    move them once more; it is empty where it cannot be told.
    """

    positions: Mapping[str, float]
    relative: bool = False
    name: str = "joint_targets"
    origin: Origin = Origin(Transport.BUS)
    stamp: float | None = None
    id: str = ""


class ReplyStatus(enum.StrEnum):
    """The four answers of ``twin.command_response.v1``."""

    ACCEPTED = "accepted"  # the robot took it
    REJECTED = "rejected"  # the host refused it before it reached the robot
    DENIED = "denied"  # the robot refused it
    TIMEOUT = "timeout"  # the robot did not answer in time


class Reply(msgspec.Struct, frozen=True, omit_defaults=True):
    """The one answer to a command, and, for whoever waits, how it ended.

    ``done`` is None in the receipt, True once the robot was seen to have done it. ``data`` is what was
    asked for, plain JSON values, in the end of a command that asks for something, and in its receipt when it
    was done at once.
    """

    command: str
    status: ReplyStatus
    reason: str = ""
    hint: str = ""
    device_result: str | None = None
    messages: tuple[str, ...] = ()
    done: bool | None = None
    data: Any = None

    @property
    def ok(self) -> bool:
        """True when the robot took the command."""
        return self.status is ReplyStatus.ACCEPTED

    @property
    def outcome(self) -> str:
        """How the command stands, for people."""
        if self.done:
            return "done"
        return self.status.value if self.ok else f"{self.status.value}: {self.reason}"


Answer = Callable[[Reply], None]
"""Gives an answer to who asked."""


class Request(msgspec.Struct, frozen=True):
    """What a robot made of a message: calling it takes the message, and answers.

    ``stops``: it can only end motion, so it is obeyed where nothing else is. ``once``: it is no part of a
    stream of setpoints, so its success is worth an answer.
    """

    take: Callable[[Answer], None]
    stops: bool = False
    once: bool = False

    def __call__(self, answer: Answer) -> None:
        """Take the message; on the loop."""
        self.take(answer)
