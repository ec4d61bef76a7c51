"""The errors of the project, in a tree whose branches say what to do about them.

    FleetError
    ├── ConfigError          fleet.yaml is invalid: edit it
    ├── WireError            a message from outside was refused; names the field
    ├── LinkError            the link to a robot
    │   ├── LinkLost         it went down: the host reopens it
    │   └── LinkRefused      it cannot be opened as configured: a person must act
    ├── BusError             the Zenoh session cannot be opened
    ├── CloudError           the broker refused the connection, or it was lost
    ├── StateError           the folder of the edge's durable state cannot be used
    │   ├── StateTaken       another running edge uses it
    │   └── StateNewer       a newer fleet wrote the file
    ├── NotRunning           no edge answers
    ├── MetricsError         the metrics for Prometheus cannot be served
    └── CommandError         a command was not carried out
        ├── NotReady         not now; try again (``hint`` says when)
        ├── Refused          this command, for this reason
        ├── Unsupported      this robot cannot do it at all
        ├── TimedOut         the robot did not answer in time
        └── Fault            a person must look at the robot

Every message is one line for the user: the error, its place, the remedy.
"""

from __future__ import annotations


class FleetError(Exception):
    """Base class of all errors that the project raises on purpose."""


class ConfigError(FleetError):
    """fleet.yaml cannot be used; ``str(error)`` lists all problems, one on each line."""


class WireError(FleetError):
    """A message from outside was refused.

    ``where`` is the dotted path of the offending field, empty for the message as a whole.
    """

    def __init__(self, message: str, *, where: str = "") -> None:
        super().__init__(f"{where}: {message}" if where else message)
        self.where = where


class NotRunning(FleetError):
    """No edge answers."""


class LinkError(FleetError):
    """The link to a robot failed."""


class LinkLost(LinkError):
    """An open link went down, or its peer fell silent; the host reopens it."""


class LinkRefused(LinkError):
    """The link cannot be opened as configured (permission, port taken, bad address)."""


class BusError(FleetError):
    """The local bus could not be opened or joined."""


class CloudError(FleetError):
    """The broker refused the connection, or the connection was lost."""


class StateError(FleetError):
    """The folder of the edge's durable state cannot be used, or another edge uses it."""


class StateTaken(StateError):
    """Another running edge uses the folder of the durable state."""


class StateNewer(StateError):
    """A state file has a format number that this fleet does not know yet; ``found`` is that number."""

    def __init__(self, message: str, *, found: int) -> None:
        super().__init__(message)
        self.found = found


class MetricsError(FleetError):
    """The metrics for Prometheus cannot be served."""


class CommandError(FleetError):
    """A command was not carried out; ``hint`` says what its sender can do.

    ``device_result`` is the robot's own result code, if it sent one. ``messages`` are the robot's texts
    during the command, oldest first.
    """

    def __init__(
        self,
        reason: str,
        *,
        hint: str = "",
        device_result: str | None = None,
        messages: tuple[str, ...] = (),
    ) -> None:
        super().__init__(f"{reason} ({hint})" if hint else reason)
        self.reason = reason
        self.hint = hint
        self.device_result = device_result
        self.messages = messages


class NotReady(CommandError):
    """The robot cannot do this now; a retry may succeed."""


class Refused(CommandError):
    """The robot, or the host on its behalf, refused this command."""


class Unsupported(CommandError):
    """This robot cannot do this at all."""


class TimedOut(CommandError):
    """The robot did not answer within the command's time-out."""


class Fault(CommandError):
    """The robot is in a state that a person must look at."""
