"""Requests to a robot (commands, velocity and joint setpoints) and the reply to each."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from fleet.model.geometry import Velocity


class Transport(enum.StrEnum):
    """Transport over which a request arrived."""

    CLOUD = "cloud"  # an MQTT topic of the twin
    BUS = "bus"  # a Zenoh query or a local setpoint
    MISSION = "mission"  # a mission that the host runs
    LOCAL = "local"  # this computer: the supervisor's socket, a stop input


class Origin(msgspec.Struct, frozen=True):
    """Sender of a request, and the transport it came over.

    ``source_type`` is the Cyberwave field as sent, None when it was missing. ``session`` identifies the
    sender to the control lease and the clock-skew estimate. ``proven``: the sender is authenticated, directly
    or by a peer that the edge trusts, such as a console with a certificate.
    """

    transport: Transport
    source_type: str | None = None
    session: str = ""
    proven: bool = False


RUN_SESSION = "run "
"""Prefix of the session of a mission run."""


def session_of(run: str) -> str:
    """Return the session in which a mission run commands its robots."""
    return f"{RUN_SESSION}{run}"


class Command(msgspec.Struct, frozen=True):
    """A discrete request to a robot; it gets exactly one receipt.

    ``id`` identifies repeats of the command: the sender's request id, or a digest of a message with a time
    stamp. It is empty when a repeat looks like a second press of the same button.
    ``stamp`` is the sender's Unix time, None when it was not given. ``flaw`` describes what is malformed in a
    stop that is obeyed all the same, and is reported to the sender; empty for a well-formed message.
    """

    name: str
    data: Mapping[str, Any] = {}
    origin: Origin = Origin(Transport.BUS)
    id: str = ""
    stamp: float | None = None
    flaw: str = ""


class Setpoint(msgspec.Struct, frozen=True):
    """A velocity to hold from now on. The newest one wins; it expires after ``lease`` s (None: default)."""

    velocity: Velocity
    name: str = "move"
    lease: float | None = None
    origin: Origin = Origin(Transport.BUS)
    stamp: float | None = None


class JointSetpoint(msgspec.Struct, frozen=True):
    """Target positions of joints by name, rad (or m). The newest one wins; each expires after its lease.

    ``relative``: the positions are offsets from the current ones. ``id`` identifies repeats of a relative
    setpoint, which would move the joints a second time; empty when a repeat cannot be recognised.
    """

    positions: Mapping[str, float]
    relative: bool = False
    name: str = "joint_targets"
    origin: Origin = Origin(Transport.BUS)
    stamp: float | None = None
    id: str = ""


class ReplyStatus(enum.StrEnum):
    """The four answers of ``twin.command_response.v1``."""

    ACCEPTED = "accepted"  # accepted by the robot
    REJECTED = "rejected"  # refused by the host, before it reached the robot
    DENIED = "denied"  # refused by the robot
    TIMEOUT = "timeout"  # the robot did not answer in time


class Reply(msgspec.Struct, frozen=True, omit_defaults=True):
    """The receipt of a command; also its final result, for a sender that waits for it.

    ``done`` is None in the receipt and True once the robot was seen to have carried out the command.
    ``data`` is the result of a query, as plain JSON values: in its final result, and in the receipt as well
    when the query was answered at once.
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
        """True when the robot accepted the command."""
        return self.status is ReplyStatus.ACCEPTED

    @property
    def outcome(self) -> str:
        """State of the command as text for the user."""
        if self.done:
            return "done"
        return self.status.value if self.ok else f"{self.status.value}: {self.reason}"


Answer = Callable[[Reply], None]
"""Sends a reply to the sender of a request."""


class Request(msgspec.Struct, frozen=True):
    """A decoded message, ready to be handled: calling it processes the message and sends the reply.

    ``stops``: the message can only end motion, so it is obeyed even where everything else is refused.
    ``once``: the message is not part of a stream of setpoints, so its success is answered as well.
    """

    handle: Callable[[Answer], None]
    stops: bool = False
    once: bool = False

    def __call__(self, answer: Answer) -> None:
        """Process the message; call it on the event loop."""
        self.handle(answer)
